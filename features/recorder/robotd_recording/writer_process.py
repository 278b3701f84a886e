"""Process that writes recordings; started by ``robotd_recorder.recorder_process``.

It reads the frames from shared memory and gets events through a pipe, so that encoding,
compression and a slow disk never delay the control loop (decision 25). When the robot's process
dies it writes what the memory still holds and closes the file.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection
from pathlib import Path
from time import monotonic

from robotd.api.features import Event, EventKind, FrameMemory, Sample
from robotd_recording.recording_folder import PARTIAL, RecordingFolder
from robotd_recording.recording_writer import (
    Picture,
    RecordingInfo,
    RecordingWriter,
    create_recording,
)

POLL_INTERVAL_S = 0.1
FLUSH_INTERVAL_S = 0.5
BLOCK_FRAMES = 250  # encoded at once
LATCHED_EVENTS = frozenset({EventKind.STATE, EventKind.STOP})


@dataclass(frozen=True)
class Job:
    """Recording to be written.

    Attributes:
        fd, axes, capacity: of the frame memory.
        cursor: of the first frame.
        info, urdf: for the file.
        folder: where the files go.
        word: last part of the file name.
        split_bytes, split_s: size and time after which a new file begins; None: one file, which
            gets its name when it is complete, and old files are removed.
    """

    fd: int
    axes: int
    capacity: int
    cursor: int
    info: RecordingInfo
    urdf: str
    folder: RecordingFolder
    word: str
    split_bytes: float | None = None
    split_s: float | None = None


@dataclass(frozen=True)
class Batch:
    """Events, samples and pictures since the last batch.

    Attributes:
        last: the recording ends with it.
        offset_ns: of a file that begins now, see ``RecordingInfo``; None: as before.
    """

    events: list[Event] = field(default_factory=list)
    samples: list[Sample] = field(default_factory=list)
    pictures: list[Picture] = field(default_factory=list)
    last: bool = False
    offset_ns: int | None = None


@dataclass(frozen=True)
class Report:
    """State of a recording.

    Attributes:
        path: file that is written, or was written last.
        size_bytes: of all its files.
        lost_frames: overwritten before they could be read.
        error: reason of the failure; "" without one.
        is_last: the recording has ended.
    """

    path: Path | None
    size_bytes: int = 0
    lost_frames: int = 0
    error: str = ""
    is_last: bool = False


class JobWriter:
    """Writes the files of one job.

    Raises OSError where a file cannot be written; what is written stays, where it is split.
    """

    def __init__(self, job: Job) -> None:
        self._job, self._info = job, job.info
        self._memory = FrameMemory(job.fd, job.axes, job.capacity)
        # The oldest frames would be overwritten before they are read.
        oldest = self._memory.written - job.capacity + BLOCK_FRAMES
        self._cursor = max(job.cursor, min(oldest, self._memory.written))
        self._lost = self._closed_bytes = 0
        self._path = self._file = Path()
        self._writer: RecordingWriter | None = None
        self._began_s = self._flushed_s = 0.0
        # Newest of each sample, and of the events that hold until the next: a new file begins
        # with them.
        self._samples: dict[str, Sample] = {}
        self._events: dict[tuple[EventKind, str], Event] = {}
        self._lacks_latched = False

    @property
    def report(self) -> Report:
        """State so far."""
        open_bytes = self._writer.size_bytes if self._writer else 0
        return Report(self._path, self._closed_bytes + open_bytes, self._lost)

    def write(self, batch: Batch) -> None:
        """Add the frames that have come since the last call, and ``batch``."""
        if batch.offset_ns is not None:
            self._info = replace(self._info, offset_ns=batch.offset_ns)
        writer = self._open()
        end = self._memory.written
        while self._cursor < end:
            frames, self._cursor, lost = self._memory.since(self._cursor, BLOCK_FRAMES)
            self._lost += lost
            writer.frames(frames)
        if self._lacks_latched and writer.has_begun:
            self._lacks_latched = False
            for latched in self._events.values():
                writer.event(latched)
            for value in self._samples.values():
                writer.sample(value)
        self._write_batch(writer, batch)
        now_s = monotonic()
        if now_s - self._flushed_s >= FLUSH_INTERVAL_S:
            writer.flush()
            self._flushed_s = now_s
        if self._is_full(writer, now_s):
            self.close()

    def _write_batch(self, writer: RecordingWriter, batch: Batch) -> None:
        for event in batch.events:
            writer.event(event)
            if event.kind in LATCHED_EVENTS:
                self._events[event.kind, event.subject] = event
        for sample in batch.samples:
            writer.sample(sample)
            self._samples[sample[1]] = sample
        for picture in batch.pictures:
            writer.picture(picture)

    def close(self) -> None:
        """Complete the current file."""
        if self._writer is not None:
            writer, self._writer = self._writer, None
            writer.close()
            self._closed_bytes += self._file.stat().st_size
            if self._file != self._path:
                self._file.rename(self._path)
                self._job.folder.remove_old(self._path)

    def discard(self) -> None:
        """Remove a file that is not complete and would get its name only then."""
        if self._file != self._path:
            with suppress(OSError):
                self._file.unlink(missing_ok=True)

    def _open(self) -> RecordingWriter:
        if self._writer is None:
            job = self._job
            self._path = job.folder.new_file(job.word)
            is_one = job.split_bytes is None
            self._file = self._path.with_suffix(PARTIAL) if is_one else self._path
            self._writer = create_recording(self._file, self._info, job.urdf)
            self._began_s = monotonic()
            self._lacks_latched = True
        return self._writer

    def _is_full(self, writer: RecordingWriter, now_s: float) -> bool:
        job = self._job
        too_large = job.split_bytes is not None and writer.size_bytes >= job.split_bytes
        return too_large or (job.split_s is not None and now_s - self._began_s >= job.split_s)


def run(connection: Connection) -> None:
    """Write one job until its last batch, or until the robot's process has died."""
    recorder = JobWriter(connection.recv())
    try:
        for batch in _batches(connection):
            recorder.write(batch or Batch())
            if batch is not None and not batch.last:
                with suppress(ConnectionError):  # the robot has gone; its batches still come
                    connection.send(recorder.report)
        recorder.close()
        report = replace(recorder.report, is_last=True)
    except OSError as error:
        recorder.discard()
        report = Report(recorder.report.path, error=error.strerror or str(error))
    connection.send(report)


def _batches(connection: Connection) -> Iterator[Batch | None]:
    """Yield batches up to the last one; None while none comes."""
    batch: Batch | None = None
    while batch is None or not batch.last:
        try:
            batch = connection.recv() if connection.poll(POLL_INTERVAL_S) else None
        except (EOFError, ConnectionError):
            batch = Batch(last=True)
        yield batch


def main() -> None:
    """Run the job of the connection whose file descriptor is the argument."""
    connection = Connection(int(sys.argv[1]))
    try:
        run(connection)
    except BrokenPipeError:
        return  # the robot's process has gone; the file is complete
