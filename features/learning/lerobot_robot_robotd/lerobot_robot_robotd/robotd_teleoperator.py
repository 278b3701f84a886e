"""A leader arm of robotd as a LeRobot teleoperator: its measured positions are actions."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

import numpy as np
from lerobot.teleoperators import Teleoperator
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError

from lerobot_robot_robotd.config_robotd_teleoperator import RobotdTeleoperatorConfig
from lerobot_robot_robotd.sigterm import sigterm_as_interrupt
from robotd import InvalidArgument, NotReady, Robot, open_robot
from robotd.api import NANOSECONDS, wait_until
from robotd.api.models import load_robot_descriptor

STALE_S = 0.2  # age of the values at which they are not an action
FIRST_VALUES_S = 5.0  # from the start to the first values


class RobotdTeleoperator(Teleoperator):
    """Arm of robotd that is moved by hand, in this process.

    Features of actions: ``<joint>.pos`` of every joint in rad or m, as those of a ``RobotdRobot``
    with the same joints. Its servos are left off. One thread.

    Raises:
        DescriptorError: the robot is unknown or its file is wrong.
        InvalidArgument: it has no joints.
    """

    config_class = RobotdTeleoperatorConfig
    name = "robotd"

    def __init__(self, config: RobotdTeleoperatorConfig) -> None:
        super().__init__(config)
        self.config = config
        descriptor = load_robot_descriptor(config.descriptor, config.variant)
        if not descriptor.joints:
            raise InvalidArgument(f"{descriptor.name} has no joints")
        self._axes = {f"{joint.name}.pos": joint.axis for joint in descriptor.joints}
        self._robot: Robot | None = None
        self._open = ExitStack()

    @property
    def action_features(self) -> dict[str, Any]:
        """Types of the values of ``get_action``; also before ``connect``."""
        return dict.fromkeys(self._axes, float)

    @property
    def feedback_features(self) -> dict[str, Any]:
        """Return {}: the arm takes no feedback."""
        return {}

    @property
    def is_connected(self) -> bool:
        """The robot has been started."""
        return self._robot is not None

    @property
    def is_calibrated(self) -> bool:
        """Return True: the descriptor and the drives have the zero positions."""
        return True

    def calibrate(self) -> None:
        """Do nothing."""

    def configure(self) -> None:
        """Do nothing: the descriptor configures the robot."""

    def connect(self, calibrate: bool = True) -> None:
        """Start the robot with its servos off.

        Until ``disconnect`` SIGTERM ends the program as Ctrl-C does, so that LeRobot disconnects.

        Raises:
            DeviceAlreadyConnectedError: it is connected.
            RobotdError: the robot does not start, or its pose does not become known.
        """
        if self._robot is not None:
            raise DeviceAlreadyConnectedError(f"{self} is already connected")
        config = self.config
        with ExitStack() as opened:
            opened.enter_context(sigterm_as_interrupt())
            robot = opened.enter_context(
                open_robot(config.descriptor, config.backend, config.variant, enable=False)
            )
            if not wait_until(lambda: not self._unknown(robot), FIRST_VALUES_S, robot.clock):
                raise NotReady(self._unknown(robot))
            self._open = opened.pop_all()
        self._robot = robot

    def get_action(self) -> dict[str, Any]:
        """Return the measured positions.

        Raises:
            DeviceNotConnectedError: before ``connect``.
            NotReady: a position is not known, or older than 0.2 s: the arm does not answer.
        """
        robot = self._connected()
        if unknown := self._unknown(robot):
            raise NotReady(unknown)
        position = robot.image.copy().position
        return {name: float(position[axis]) for name, axis in self._axes.items()}

    def _unknown(self, robot: Robot) -> str:
        """Return why the pose of the arm is not known; "" while it is."""
        image = robot.image.copy()
        age_s = (robot.clock.now_ns() - image.fresh_ns) / NANOSECONDS
        if not image.fresh_ns or age_s > STALE_S:
            return f"{robot.descriptor.name} does not answer: its pose is not known"
        for name, axis in self._axes.items():
            if image.offline[axis] or not np.isfinite(image.position[axis]):
                return f"{name} is not known: {image.fault(axis) or 'no value arrives'}"
        return ""

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Do nothing: the arm takes no feedback."""

    def disconnect(self) -> None:
        """Close the robot. Raises DeviceNotConnectedError before ``connect``."""
        self._connected()
        self._robot = None
        self._open.close()

    def _connected(self) -> Robot:
        if self._robot is None:
            raise DeviceNotConnectedError(f"{self} is not connected: call connect() first")
        return self._robot
