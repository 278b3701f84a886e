"""A folder that cannot be written to is named with the reason."""

from __future__ import annotations

import resource
from collections.abc import Iterator
from pathlib import Path

import pytest

from robotd.folders import MIB, why_unwritable


@pytest.fixture
def small_files() -> Iterator[None]:
    """Let no file of this process grow beyond 1 MiB."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (MIB, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_folder_with_room_is_made_and_left_empty(tmp_path: Path) -> None:
    assert why_unwritable(tmp_path / "a" / "b", 2 * MIB) == ""
    assert list((tmp_path / "a" / "b").iterdir()) == []


def test_a_folder_without_room_for_the_file_is_named(tmp_path: Path, small_files: None) -> None:
    assert why_unwritable(tmp_path) == ""
    assert why_unwritable(tmp_path, 2 * MIB) == f"{tmp_path}: File too large"


def test_a_full_disk_says_how_much_is_needed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(fd: int, offset: int, length: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.posix_fallocate", full)
    assert why_unwritable(tmp_path) == f"{tmp_path}: No space left on device"
    assert why_unwritable(tmp_path, 16 * MIB).endswith("left on device, 16 MiB are needed")


def test_a_folder_below_a_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert why_unwritable(tmp_path / "file" / "a") == f"{tmp_path / 'file' / 'a'}: Not a directory"
