"""Camera of the simulated world that the robot is in, as a camera of LeRobot's robots."""

# No "from __future__ import annotations": draccus needs the types at run time.
from dataclasses import dataclass
from typing import Any

from lerobot.cameras import CameraConfig
from lerobot.utils.errors import DeviceNotConnectedError

from robotd import InvalidArgument, Robot
from robotd.api import World, unknown_name


@CameraConfig.register_subclass("robotd_world")
@dataclass(kw_only=True)
class WorldCameraConfig(CameraConfig):
    """Options of ``{type: robotd_world}``; ``width`` and ``height`` are those of the scene.

    Attributes:
        camera: name in the scene of the backend.
    """

    camera: str


class WorldCamera:
    """Renders a picture of the robot's world when it is asked for one. One thread.

    Attributes:
        robot: that has been started; None: it is not connected.
    """

    def __init__(self, config: WorldCameraConfig) -> None:
        self.robot: Robot | None = None
        self._config = config

    @property
    def is_connected(self) -> bool:
        """The robot has been started."""
        return self.robot is not None

    def connect(self) -> None:
        """Check that the world of ``robot`` has the camera, and take a first picture.

        The first one opens OpenGL, which can stall the control loop: before anything moves.

        Raises InvalidArgument: it has no such camera, or one of another size.
        """
        config, world = self._config, self._world
        known = {camera.name: camera for camera in world.cameras} if world is not None else {}
        if config.camera not in known:
            raise InvalidArgument(unknown_name("camera", config.camera, known))
        width, height = known[config.camera].width, known[config.camera].height
        if (width, height) != (config.width, config.height):
            raise InvalidArgument(
                f"camera {config.camera!r}: width and height must be {width} and {height}, as in"
                f" the scene, not {config.width} and {config.height}"
            )
        self.read_latest()

    def read_latest(self) -> Any:
        """Return the present picture, uint8 of shape (height, width, 3).

        Raises DeviceNotConnectedError before ``connect``.
        """
        if self._world is None:
            raise DeviceNotConnectedError(f"camera {self._config.camera!r} is not connected")
        return self._world.image(self._config.camera)

    def disconnect(self) -> None:
        """Let go of the robot."""
        self.robot = None

    @property
    def _world(self) -> World | None:
        return self.robot.world if self.robot is not None else None
