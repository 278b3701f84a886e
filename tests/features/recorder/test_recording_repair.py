from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from tests.features.recorder.frames import PERIOD_NS, ramp, write

from robotd.clock import NANOSECONDS
from robotd.events import Event, EventKind
from robotd_recording.recording_reader import RecordingError, read_recording
from robotd_recording.recording_repair import recover


@pytest.mark.parametrize("missing", [1, 500, 5000])
def test_the_complete_chunks_of_a_file_that_was_cut_off_are_kept(
    tmp_path: Path, missing: int
) -> None:
    path = tmp_path / "cut.mcap"
    frames = ramp(1000)
    write(path, frames)
    whole = path.read_bytes()
    path.write_bytes(whole[:-missing])
    found = recover(path)
    assert found is not None
    assert found.damaged.read_bytes() == whole[:-missing]
    kept = read_recording(path).frames
    assert len(kept) >= 700
    np.testing.assert_array_equal(kept["values"], frames["values"][: len(kept)])


def test_older_lines_of_the_log_do_not_lengthen_the_recording(tmp_path: Path) -> None:
    path = tmp_path / "late.mcap"
    started = Event(-100 * NANOSECONDS, EventKind.LOG, "serve", "ready")
    write(path, ramp(1000), events=[started])
    path.write_bytes(path.read_bytes()[:-1])
    found = recover(path)
    assert found is not None
    assert found.duration_s == pytest.approx(999 * PERIOD_NS / NANOSECONDS)


def test_a_damaged_chunk_ends_the_recording(tmp_path: Path) -> None:
    path = tmp_path / "damaged.mcap"
    frames = ramp(1000)
    write(path, frames)
    data = bytearray(path.read_bytes())
    chunks = [match.start() for match in re.finditer(rb"\x28\xb5\x2f\xfd", data)]  # of zstd
    data[chunks[3] + 200] ^= 0xFF
    path.write_bytes(data)
    recover(path)
    kept = read_recording(path).frames
    assert 100 <= len(kept) < 1000
    np.testing.assert_array_equal(kept["values"], frames["values"][: len(kept)])


def test_a_complete_file_stays_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "whole.mcap"
    write(path, ramp(1000))
    whole = path.read_bytes()
    assert recover(path) is None
    assert [path.name for path in tmp_path.iterdir()] == ["whole.mcap"]
    assert path.read_bytes() == whole


def test_a_file_without_a_complete_chunk_stays_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "short.mcap"
    path.write_bytes(b"\x89MCAP0\r\n\x01")
    with pytest.raises(RecordingError, match="no complete chunk"):
        recover(path)
    assert [path.name for path in tmp_path.iterdir()] == ["short.mcap"]
    assert path.read_bytes() == b"\x89MCAP0\r\n\x01"
