"""Pictures of the cameras of a world: when they are due, and as JPEG."""

from __future__ import annotations

import io
import threading
import time
from collections.abc import Iterator, Sequence
from typing import Any

from numpy.typing import NDArray

from robotd.clock import NANOSECONDS, Clock
from robotd.clock.simulated import ticks
from robotd.device.world import World, WorldCamera
from robotd.errors import InvalidArgument, OperationError, unknown_name

JPEG_QUALITY = 90


def jpeg(picture: NDArray[Any]) -> bytes:
    """Return a picture, uint8 of shape (height, width, 3), as JPEG.

    Raises OperationError: Pillow is not installed.
    """
    try:
        from PIL import Image
    except ImportError as error:
        raise OperationError("compressed pictures need Pillow: pip install pillow") from error
    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, "JPEG", quality=JPEG_QUALITY)
    return stream.getvalue()


def due_cameras(
    cameras: Sequence[WorldCamera], stop: threading.Event, clock: Clock
) -> Iterator[tuple[int, WorldCamera]]:
    """Yield the time in ns and a camera whenever a picture of it is due, until ``stop``.

    In simulated time none is skipped: time waits for the caller, who has a thread of its own.

    Args:
        cameras: at least one.
        stop: ends it.
        clock: of the robot.
    """
    due_ns = dict.fromkeys((camera.name for camera in cameras), 0)
    period_ns = round(NANOSECONDS / max(camera.rate_hz for camera in cameras))
    with ticks(stop, period_ns, clock) as moments:
        for _ in moments:
            now_ns = clock.now_ns()
            for camera in cameras:
                if now_ns >= due_ns[camera.name]:
                    # A little early, so that a tick just before the due time is not the one after.
                    due_ns[camera.name] = now_ns + round(0.99 * NANOSECONDS / camera.rate_hz)
                    yield now_ns, camera


class CameraPictures:
    """Pictures for any number of viewers: each is rendered once in a period of its camera.

    Any thread may call.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._cameras = {camera.name: camera for camera in world.cameras}
        self._lock = threading.Lock()
        self._newest: dict[str, tuple[float, bytes]] = {}  # time and JPEG, by camera

    def newest(self, camera: str) -> bytes:
        """Return a picture as JPEG, not older than a period of the camera.

        Raises InvalidArgument for an unknown camera, OperationError where pictures cannot be made.
        """
        if camera not in self._cameras:
            raise InvalidArgument(unknown_name("camera", camera, self._cameras))
        with self._lock:
            made_s, found = self._newest.get(camera, (-1.0, b""))
            now_s = time.monotonic()
            if not found or now_s - made_s >= 1.0 / self._cameras[camera].rate_hz:
                found = jpeg(self._world.image(camera))
                self._newest[camera] = now_s, found
            return found
