"""Pictures of the cameras of a simulated world, for a continuous recording."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence
from typing import Self

from robotd.api import RobotdError, World, WorldCamera, due_cameras, get_logger, jpeg
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
        try:
            for now_ns, camera in due_cameras(self._cameras, self._stop, self._robot.clock):
                data = jpeg(world.image(camera.name))
                self._waiting.append(Picture(now_ns, camera.name, data))
        except RobotdError as error:
            log.error("no pictures in the recording", reason=str(error))
