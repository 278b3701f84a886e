"""Pictures of the cameras of a world, as JPEG."""

from __future__ import annotations

import io
import threading
import time
from typing import Any

from numpy.typing import NDArray

from robotd.device.world import World
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


class CameraPictures:
    """Pictures for any number of viewers: each is rendered once in a period of its camera.

    Any thread may call.

    Args:
        world: with the cameras.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._cameras = {each.name: each for each in world.cameras}
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
