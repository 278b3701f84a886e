"""Parent's side of the process that writes a recording."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Sequence
from importlib.metadata import version
from multiprocessing.connection import Pipe
from pathlib import Path
from threading import Thread
from typing import Self

from robotd.api import NANOSECONDS
from robotd.api.features import Event, Sample, Tap
from robotd_recording import writer_process
from robotd_recording.recording_folder import RecordingFolder
from robotd_recording.recording_writer import Picture, RecordingInfo
from robotd_recording.writer_process import Batch, Job, Report

BATCH_EVENTS = 32  # pickled at once, which holds the interpreter: 0.2 ms
# Not ``-m``: the classes of ``__main__`` would not be the ones that are received here.
NICENESS = 10
# Before it imports anything: after a stop of all robots of a computer each saves a recording. The
# niceness is absolute, as that of the robot may be below 0.
PROGRAM = f"""
import os
from contextlib import suppress
with suppress(OSError):
    os.setpriority(os.PRIO_PROCESS, 0, {NICENESS})
from {writer_process.__name__} import main
main()
"""
END_S = 5.0  # for a process that is asked to end
LOOK_S = 0.05  # least time between two looks at it
PATIENCE = 5  # times its time-out, with a process that waits for a processor


class RecorderProcess:
    """Process that writes a recording: ``with RecorderProcess(...) as process:``. One thread.

    Leaving the block without ``finish`` also completes the file, without waiting for it.

    Args:
        split_bytes, split_s: see ``Job``.

    Raises OSError, in every method: the process cannot be started, or its file not be written.
    """

    def __init__(
        self,
        tap: Tap,
        folder: RecordingFolder,
        word: str,
        cause: Event | None,
        *,
        cursor: int = 0,
        split_bytes: float | None = None,
        split_s: float | None = None,
    ) -> None:
        frames, self._tap = tap.frames, tap
        self._yield = tap.robot.control_loop.yield_to_control_loop
        self._connection, theirs = Pipe()
        try:
            self._process = subprocess.Popen(  # noqa: S603 - our own module
                [sys.executable, "-c", PROGRAM, str(theirs.fileno())],
                pass_fds=(theirs.fileno(), frames.fd),
                stdin=subprocess.DEVNULL,
                # What a terminal sends is for the robot, which ends this. Not a session of its own:
                # Linux gives each as much of the processor, whatever the niceness of its processes.
                process_group=0,
            )
        finally:
            theirs.close()
        self._connection.send(
            Job(
                frames.fd,
                frames.axes,
                frames.capacity,
                cursor,
                recording_info(tap, cause),
                tap.urdf,
                folder,
                word,
                split_bytes,
                split_s,
            )
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._connection.close()
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:  # a busy computer: it ends by itself, and is reaped then
            Thread(target=self._process.wait, name="robotd-reaper", daemon=True).start()

    def send(
        self, events: Sequence[Event], samples: Sequence[Sample], pictures: Sequence[Picture] = ()
    ) -> Report | None:
        """Add events, samples and pictures; return the newest report, None before the first."""
        for begin in range(0, len(events), BATCH_EVENTS):
            self._put(Batch([*events[begin : begin + BATCH_EVENTS]]))
            self._yield()
        self._put(Batch([], [*samples], [*pictures], offset_ns=self._tap.offset_ns))
        report = None
        while self._connection.poll():
            report = self._receive()
        return report

    def finish(self, timeout_s: float) -> Report:
        """Complete the file and return its report.

        Time in which the process waits for a processor does not count, up to ``PATIENCE`` times
        ``timeout_s``: its niceness leaves little to it on a busy computer. Raises TimeoutError.
        """
        self._put(Batch(last=True))
        began_s, queued_s, left_s = time.monotonic(), self._queued_s(), timeout_s
        while left_s > 0.0:
            if self._connection.poll(max(left_s, LOOK_S)) and (report := self._receive()).is_last:
                return report
            passed_s = time.monotonic() - began_s
            had_s = passed_s - (self._queued_s() - queued_s)
            left_s = min(timeout_s - had_s, PATIENCE * timeout_s - passed_s)
        raise TimeoutError(f"the recording is not complete after {timeout_s:g} s")

    def _queued_s(self) -> float:
        """Return how long the process has waited for a processor; 0 where that is not counted."""
        try:
            text = Path(f"/proc/{self._process.pid}/schedstat").read_text(encoding="ascii")
            return int(text.split()[1]) / NANOSECONDS
        except (OSError, IndexError, ValueError):
            return 0.0

    def _put(self, batch: Batch) -> None:
        """Send a batch. Raises OSError, with the reason of a writer that has ended."""
        try:
            self._connection.send(batch)
        except BrokenPipeError:
            while self._connection.poll():
                self._receive()  # raises the reason that its last report has
            raise

    def _receive(self) -> Report:
        try:
            report: Report = self._connection.recv()
        except (EOFError, ConnectionError) as error:
            raise OSError("the process that writes it has ended") from error
        if report.error:
            raise OSError(report.error)
        return report


def recording_info(tap: Tap, cause: Event | None) -> RecordingInfo:
    """Return the metadata of a recording that is written for ``cause``."""
    robot = tap.robot
    descriptor = robot.descriptor
    return RecordingInfo(
        robot=descriptor.name,
        backend=robot.backend.name,
        variant=descriptor.variant or "",
        version=version("robotd"),
        cause=cause.text if cause else "",
        rate_hz=descriptor.cycle.rate_hz,
        axes=robot.axes.names,
        joints=robot.joint_axes,
        limits={
            robot.axes.names[axis]: (limit.lower, limit.upper, limit.velocity, limit.acceleration)
            for axis in robot.joint_axes
            for limit in [robot.axes.limits[axis]]
        },
        offset_ns=tap.offset_ns,
        units={joint.name: joint.unit for joint in descriptor.joints},
        fingers=robot.gripper.finger_ends if robot.gripper is not None else {},
        cause_ns=cause.time_ns if cause else 0,
    )
