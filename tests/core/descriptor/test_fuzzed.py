"""A fixed part of what ``python -m tools.fuzz`` tries without end."""

from __future__ import annotations

from pathlib import Path

import pytest
from tools.fuzz.campaign import make_input, try_input
from tools.fuzz.readers import READERS, Reader

SEED = 20261121
INPUTS = 60


@pytest.mark.filterwarnings("ignore")  # of libraries, about what they are given here
@pytest.mark.parametrize("reader", READERS, ids=[reader.name for reader in READERS])
def test_bad_files_are_rejected_in_order(reader: Reader, tmp_path: Path) -> None:
    for index in range(INPUTS):
        found = try_input(reader, make_input(reader, SEED, index), tmp_path)
        assert found is None, f"--seed {SEED} --reader {reader.name} --index {index}\n{found}"


@pytest.mark.parametrize("reader", READERS, ids=[reader.name for reader in READERS])
def test_an_input_depends_on_its_seed_alone(reader: Reader) -> None:
    first, again, other = (make_input(reader, seed, 7) for seed in (1, 1, 2))
    assert first == again
    assert first != other


def test_the_fuzzer_finds_what_is_wrong(tmp_path: Path) -> None:
    def fail(path: Path) -> None:
        raise ZeroDivisionError

    broken = Reader("x", "x", (), fail, READERS[0].mutate, READERS[0].generate)
    assert "ZeroDivisionError" in str(try_input(broken, b"", tmp_path))
