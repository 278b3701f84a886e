"""Continuous recording: everything, from a start to a stop, split by size and time."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence
from typing import Self

from robotd.api import (
    OperationError,
    RobotdError,
    World,
    WorldCamera,
    due_cameras,
    get_logger,
    jpeg,
)
from robotd.api.features import Tap
from robotd.api.robots import Robot
from robotd_recorder.recorder_process import RecorderProcess
from robotd_recording.recording_folder import CONTINUOUS, RecordingFolder
from robotd_recording.recording_writer import Picture
from robotd_recording.writer_process import Report

log = get_logger("recorder")

SEND_INTERVAL_S = 0.25
END_TIMEOUT_S = 30.0
MAX_WAITING = 256  # pictures that the writing process has not got yet
PICTURES_TIMEOUT_S = 5.0


class CameraRecorder:
    """Takes pictures at the rates of the cameras: ``with CameraRecorder(...) as pictures:``.

    Its thread is ``robotd-record-cameras``; without cameras there is none. In simulated time no
    picture is skipped: time waits for them.

    Args:
        robot: in the world of the cameras.
    """

    def __init__(self, robot: Robot, cameras: Sequence[WorldCamera]) -> None:
        self._robot, self._cameras = robot, cameras
        self._waiting: deque[Picture] = deque(maxlen=MAX_WAITING)
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def __enter__(self) -> Self:
        world = self._robot.world
        if self._cameras and world is not None:
            self._thread = threading.Thread(
                target=self._run, args=(world,), name="robotd-record-cameras", daemon=True
            )
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        if self._thread is not None:
            self._thread.join(PICTURES_TIMEOUT_S)

    def take(self) -> list[Picture]:
        """Return the pictures since the last call."""
        return [self._waiting.popleft() for _ in range(len(self._waiting))]

    def _run(self, world: World) -> None:
        try:
            for now_ns, camera in due_cameras(self._cameras, self._stop, self._robot.clock):
                data = jpeg(world.image(camera.name))
                self._waiting.append(Picture(now_ns, camera.name, data))
        except RobotdError as error:
            log.error("no pictures in the recording", reason=str(error))


class ContinuousRecorder:
    """Records while it is started; the thread ``robotd-record`` feeds the writing process.

    Any thread may call. A disk that is full ends the recording and nothing else.

    Args:
        folder: where the files go; none is ever removed.
        split_bytes, split_s: size and time after which a new file begins.
        cameras: whose pictures are recorded, too.
    """

    def __init__(
        self,
        tap: Tap,
        folder: RecordingFolder,
        split_bytes: float,
        split_s: float,
        cameras: Sequence[WorldCamera] = (),
    ) -> None:
        self._cameras = cameras
        self._tap = tap
        self._folder = folder
        self._split_bytes, self._split_s = split_bytes, split_s
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._report = Report(None)
        self._failure = ""

    @property
    def is_recording(self) -> bool:
        """True while a recording was started and has not ended."""
        return self._thread is not None and self._thread.is_alive()

    @property
    def report(self) -> Report:
        """State of the recording, or of the last one."""
        return self._report

    def start(self) -> None:
        """Start. Raises OperationError: it records already, or the process cannot be started."""
        with self._lock:
            if self.is_recording:
                raise OperationError(f"already recording to {self._report.path}")
            self._stop.clear()
            self._failure, self._report = "", Report(None)
            tap = self._tap
            try:
                process = RecorderProcess(
                    tap,
                    self._folder,
                    CONTINUOUS,
                    None,
                    cursor=tap.frames.written,
                    split_bytes=self._split_bytes,
                    split_s=self._split_s,
                )
            except OSError as error:
                raise OperationError(f"recording does not start: {error}") from error
            self._thread = threading.Thread(
                target=self._run, args=(process,), name="robotd-record", daemon=True
            )
            self._thread.start()

    def stop(self) -> Report:
        """Complete the file and return its report.

        Raises OperationError: nothing was recorded, or the recording is not complete.
        """
        with self._lock:
            if self._thread is None:
                raise OperationError("nothing is being recorded")
            self._stop.set()
            self._thread.join(END_TIMEOUT_S)
            if self._thread.is_alive():
                raise OperationError(f"the recording is not complete after {END_TIMEOUT_S:g} s")
            self._thread = None
            if self._failure:
                raise OperationError(f"the recording ended early: {self._failure}")
            return self._report

    def close(self) -> None:
        """Stop if it records; what fails is logged by the thread."""
        if self.is_recording:
            try:
                self.stop()
            except OperationError as error:
                log.error("recording not complete", reason=str(error))

    def _run(self, process: RecorderProcess) -> None:
        try:
            with process, CameraRecorder(self._tap.robot, self._cameras) as pictures:
                self._feed(process, pictures)
            report = self._report
            log.info("recorded", file=str(report.path), mib=round(report.size_bytes / 2**20, 1))
            if report.lost_frames:
                log.warning("frames lost: the disk is too slow", frames=report.lost_frames)
        except OSError as error:
            self._failure = error.strerror or str(error)
            log.error("recording ended early", folder=str(self._folder.path), reason=self._failure)

    def _feed(self, process: RecorderProcess, pictures: CameraRecorder) -> None:
        tap = self._tap
        event_cursor = sample_cursor = 0
        has_stopped = False
        while not has_stopped:
            has_stopped = self._stop.wait(SEND_INTERVAL_S)
            events, event_cursor = tap.events.since(event_cursor)
            samples, sample_cursor = tap.samples.since(sample_cursor)
            self._report = process.send(events, samples, pictures.take()) or self._report
        self._report = process.finish(END_TIMEOUT_S)
