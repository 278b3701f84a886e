"""Pictures of the cameras of a simulated world, for a continuous recording."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence
from typing import Self

from robotd.api import NANOSECONDS, RobotdError, World, WorldCamera, get_logger, jpeg, ticks
from robotd.api.robots import Robot
from robotd_recording.recording_writer import Picture

log = get_logger("recorder")

MAX_WAITING = 256  # pictures that the writing process has not got yet
END_TIMEOUT_S = 5.0


class CameraRecorder:
    """Takes pictures at the rates of the cameras: ``with CameraRecorder(...) as pictures:``.

    Its thread is ``robotd-record-cameras``; without cameras there is none. In simulated time no
    picture is skipped: time waits for them.

    Args:
        robot: in the world of the cameras.
        cameras: of its world.
    """

    def __init__(self, robot: Robot, cameras: Sequence[WorldCamera]) -> None:
        self._robot, self._cameras = robot, cameras
        self._due_ns = dict.fromkeys((each.name for each in cameras), 0)
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
            self._thread.join(END_TIMEOUT_S)

    def take(self) -> list[Picture]:
        """Return the pictures since the last call."""
        return [self._waiting.popleft() for _ in range(len(self._waiting))]

    def _run(self, world: World) -> None:
        period_ns = round(NANOSECONDS / max(each.rate_hz for each in self._cameras))
        try:
            with ticks(self._stop, period_ns, self._robot.clock) as moments:
                for _ in moments:
                    now_ns = self._robot.clock.now_ns()
                    for camera in self._cameras:
                        if now_ns >= self._due_ns[camera.name]:
                            self._record(world, camera, now_ns)
        except RobotdError as error:
            log.error("no pictures in the recording", reason=str(error))

    def _record(self, world: World, camera: WorldCamera, now_ns: int) -> None:
        # A little early, so that a tick just before the due time is not the one after it.
        self._due_ns[camera.name] = now_ns + round(0.99 * NANOSECONDS / camera.rate_hz)
        data = jpeg(world.image(camera.name))
        self._waiting.append(Picture(now_ns, camera.name, data))
