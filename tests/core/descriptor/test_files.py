"""Names that lead to something else than a file of a fair size: rejected, at once."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from robotd.descriptor import load_robot_descriptor
from robotd.descriptor.files import is_file, read_limited
from robotd.errors import DescriptorError
from robotd_wmx_parameters import read_wmx_parameters

LIMIT = 1000
Make = Callable[[Path], object]


def sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(10_000_000_000)


NO_FILES = {
    "absent": (lambda path: None, "No such file"),
    "a folder": (Path.mkdir, "not a regular file"),
    "a named pipe": (os.mkfifo, "not a regular file"),
    "endless zeros": (lambda path: path.symlink_to("/dev/zero"), "not a regular file"),
    "a loop": (lambda path: path.symlink_to(path), "Too many levels of symbolic links"),
    "10 GB": (sparse, r"larger than the limit of 1_000 bytes"),
}


@pytest.mark.timeout(5)
@pytest.mark.parametrize(("make", "reason"), NO_FILES.values(), ids=NO_FILES.keys())
def test_what_is_no_file_of_a_fair_size(tmp_path: Path, make: Make, reason: str) -> None:
    path = tmp_path / "x"
    make(path)
    with pytest.raises(DescriptorError, match=reason) as caught:
        read_limited(path, LIMIT)
    assert caught.value.path == path


@pytest.mark.parametrize("name", ["a\0b", "a" * 256, "/a" * 5000, "\udcff", "/proc/self/mem"])
def test_names_that_the_system_refuses(name: str) -> None:
    with pytest.raises(DescriptorError, match=r"cannot be read|larger|not a regular"):
        read_limited(Path(name), LIMIT)
    assert is_file(Path(name)) is (name == "/proc/self/mem")


def test_a_pipe_that_takes_the_place_of_a_file_is_not_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "x"
    os.mkfifo(path)
    monkeypatch.setattr("robotd.descriptor.files._mode", lambda path: 0o100644)
    with pytest.raises(DescriptorError, match="not a regular file"):
        read_limited(path, LIMIT)


@pytest.mark.parametrize("read", [read_wmx_parameters, load_robot_descriptor])
@pytest.mark.parametrize("make", [os.mkfifo, sparse])
def test_readers_look_at_the_file_first(
    tmp_path: Path, read: Callable[[Path], object], make: Make
) -> None:
    path = tmp_path / "x.yaml"
    make(path)
    with pytest.raises(DescriptorError, match=r"not a regular file|larger than the limit"):
        read(path)


def test_a_file_as_long_as_the_limit(tmp_path: Path) -> None:
    path = tmp_path / "x"
    path.write_bytes(b"x" * LIMIT)
    assert len(read_limited(path, LIMIT)) == LIMIT
