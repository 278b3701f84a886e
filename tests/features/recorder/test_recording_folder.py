"""Names of recordings, and removal of old ones."""

from __future__ import annotations

import os
from pathlib import Path

from robotd_recording.recording_folder import RecordingFolder


def add(folder: Path, name: str, age_s: int, size: int = 10) -> Path:
    path = folder / name
    path.write_bytes(bytes(size))
    os.utime(path, (1e9 - age_s, 1e9 - age_s))
    return path


def test_names_are_free_and_say_robot_and_reason(tmp_path: Path) -> None:
    folder = RecordingFolder(tmp_path, "arm", 10, 1e6)
    names = set()
    for _ in range(3):
        path = folder.new_file("fault")
        path.with_suffix(".part").touch()
        names.add(path.name)
    assert len(names) == 3
    assert all(name.startswith("arm-") and "-fault" in name for name in names)


def test_the_oldest_beyond_the_number_are_removed(tmp_path: Path) -> None:
    files = [add(tmp_path, f"arm-{age}.mcap", age) for age in range(4)]
    other = add(tmp_path, "leg-9.mcap", 9)
    assert RecordingFolder(tmp_path, "arm", 2, 1e6).remove_old(files[0]) == files[2:]
    assert [file.exists() for file in (*files, other)] == [True, True, False, False, True]


def test_the_newest_is_kept_whatever_its_size(tmp_path: Path) -> None:
    newest, older = add(tmp_path, "arm-1.mcap", 1, 900), add(tmp_path, "arm-2.mcap", 2)
    assert RecordingFolder(tmp_path, "arm", 9, 100).remove_old(newest) == [older]
    assert newest.exists()


def test_continuous_recordings_neither_count_nor_go(tmp_path: Path) -> None:
    continuous = add(tmp_path, "arm-1-record.mcap", 9, 900)
    faults = [add(tmp_path, f"arm-{age}-fault.mcap", age) for age in range(3)]
    assert RecordingFolder(tmp_path, "arm", 2, 500).remove_old(faults[0]) == faults[2:]
    assert continuous.exists()


def test_a_recording_stays_that_was_written_after_the_clock_was_set_back(tmp_path: Path) -> None:
    newest = add(tmp_path, "arm-new-fault.mcap", 1000)
    files = [add(tmp_path, f"arm-{age}-fault.mcap", age) for age in range(2)]
    assert RecordingFolder(tmp_path, "arm", 2, 1e6).remove_old(newest) == files[1:]
    assert newest.exists()


def test_a_robot_may_have_the_name_of_continuous_recordings(tmp_path: Path) -> None:
    faults = [add(tmp_path, f"record-{age}-fault.mcap", age) for age in range(3)]
    assert RecordingFolder(tmp_path, "record", 2, 1e6).remove_old(faults[0]) == faults[2:]
