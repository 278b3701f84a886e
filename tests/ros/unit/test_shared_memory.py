"""Segments of the dead go, those of the living stay."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from robotd_ros.middleware.shared_memory import YOUNG_S, remove_leftovers

NAME = "fastrtps_0123456789abcdef"


def made(folder: Path, name: str = NAME, age_s: float = 2 * YOUNG_S) -> Path:
    """A segment and its lock file; returns the lock file."""
    lock = folder / f"{name}_el"
    for path in (folder / name, lock):
        path.write_bytes(b"x")
        before_s = path.stat().st_mtime - age_s
        os.utime(path, (before_s, before_s))
    return lock


@pytest.fixture
def held(tmp_path: Path) -> Iterator[Path]:
    """A lock file that somebody holds."""
    lock = made(tmp_path)
    with lock.open() as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield lock


def test_a_segment_without_an_owner_is_removed(tmp_path: Path) -> None:
    made(tmp_path)
    made(tmp_path, "fastrtps_fedcba9876543210")
    assert remove_leftovers(tmp_path) == 2
    assert list(tmp_path.iterdir()) == []


def test_a_lock_file_alone_is_removed(tmp_path: Path) -> None:
    made(tmp_path)
    (tmp_path / NAME).unlink()
    assert remove_leftovers(tmp_path) == 1
    assert list(tmp_path.iterdir()) == []


def test_a_segment_in_use_stays(tmp_path: Path, held: Path) -> None:
    assert remove_leftovers(tmp_path) == 0
    assert sorted(tmp_path.iterdir()) == [tmp_path / NAME, held]


@pytest.mark.parametrize(
    ("name", "age_s"),
    [
        (NAME, 0.0),  # its owner may be about to lock it
        ("fastrtps_port7413", 2 * YOUNG_S),  # a port is used again by the next process
        ("fastrtps_0123456789ABCDEF", 2 * YOUNG_S),
        ("robotd_0123456789abcdef", 2 * YOUNG_S),
    ],
)
def test_other_files_stay(tmp_path: Path, name: str, age_s: float) -> None:
    made(tmp_path, name, age_s)
    assert remove_leftovers(tmp_path) == 0
    assert len(list(tmp_path.iterdir())) == 2


def test_a_link_is_not_followed(tmp_path: Path) -> None:
    elsewhere = made(tmp_path, "elsewhere")
    (tmp_path / f"{NAME}_el").symlink_to(elsewhere)
    assert remove_leftovers(tmp_path) == 0
    assert elsewhere.exists()


def test_without_shared_memory_there_is_nothing_to_do(tmp_path: Path) -> None:
    assert remove_leftovers(tmp_path / "none") == 0
