"""A seed leads to the same run each time: else nobody can look for what it found."""

from __future__ import annotations

import pytest
from tests.witness.backends import BENCHES, RATE_HZ
from tests.witness.judge import Command
from tests.witness.one_by_one import one_by_one
from tests.witness.play import WitnessPlay

# The benches in which robotd has most threads.
SEEDS = [("canopen-base", 9), ("keeping-base", 3), ("ethercat-base", 1), ("feetech", 2)]


def played(name: str, seed: int) -> tuple[list[str], list[list[Command]]]:
    """Return the commands of the clients, and the last ones that each drive executed."""
    with one_by_one():
        play = WitnessPlay(BENCHES[name](rate_hz=RATE_HZ))
        play.play(seed)
    return play.log, [list(judge.commands) for judge in play.bench.judges]


@pytest.mark.long
@pytest.mark.parametrize(("backend", "seed"), SEEDS)
def test_a_seed_leads_to_the_same_commands(backend: str, seed: int) -> None:
    log, executed = played(backend, seed)
    assert played(backend, seed) == (log, executed)
    assert all(executed)
