"""A robotd robot as a LeRobot robot: joints by streams, gripper by its output, cameras."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import ExitStack
from typing import Any

from lerobot.cameras import make_cameras_from_configs
from lerobot.robots import Robot as LeRobotRobot
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError

from lerobot_robot_robotd.config_robotd_robot import RobotdRobotConfig
from lerobot_robot_robotd.gripper_value import GripperValue
from lerobot_robot_robotd.sigterm import sigterm_as_interrupt
from lerobot_robot_robotd.world_camera import WorldCamera, WorldCameraConfig
from robotd import InvalidArgument, Robot, open_robot
from robotd.api.models import load_robot_descriptor
from robotd.api.robots import JointStream

OWNER = "lerobot"
GRIPPER = "gripper.pos"


class RobotdRobot(LeRobotRobot):
    """Robot of robotd, in this process.

    Features of actions and observations: ``<joint>.pos`` of every joint in rad or m, and
    ``gripper.pos``, the position of a finger in m, where the robot has a gripper. Observations
    also have the images of the cameras and, with ``velocities``, ``<joint>.vel``. One thread.

    Raises:
        DescriptorError: the robot is unknown or its file is wrong.
        InvalidArgument: it has no joints.
    """

    config_class = RobotdRobotConfig
    name = "robotd"

    def __init__(self, config: RobotdRobotConfig) -> None:
        super().__init__(config)
        self.config = config
        descriptor = load_robot_descriptor(config.descriptor, config.variant)
        self.robot_type = descriptor.name  # of datasets: policies are for one robot
        if not descriptor.joints:
            raise InvalidArgument(f"{descriptor.name} has no joints")
        self._joints = {f"{joint.name}.pos": joint for joint in descriptor.joints}
        self._farthest = _farthest(config.max_relative_target, descriptor.joint_names)
        self._gripper_settings = descriptor.gripper
        self._gripper: GripperValue | None = None
        self._robot: Robot | None = None
        self._streams: list[JointStream] = []
        self._open = ExitStack()
        of_world = {
            name: WorldCamera(camera)
            for name, camera in config.cameras.items()
            if isinstance(camera, WorldCameraConfig)
        }
        others = {name: camera for name, camera in config.cameras.items() if name not in of_world}
        self.cameras: dict[str, Any] = make_cameras_from_configs(others) | of_world

    @property
    def action_features(self) -> dict[str, Any]:
        """Types of the values of ``send_action``; also before ``connect``."""
        gripper = {GRIPPER: float} if self._gripper_settings else {}
        return dict.fromkeys(self._joints, float) | gripper

    @property
    def observation_features(self) -> dict[str, Any]:
        """Types of the values of ``get_observation``, (height, width, 3) of images."""
        speeds = [f"{joint.name}.vel" for joint in self._joints.values()]
        cameras = self.config.cameras.items()
        return (
            self.action_features
            | (dict.fromkeys(speeds, float) if self.config.velocities else {})
            | {name: (camera.height, camera.width, 3) for name, camera in cameras}
        )

    @property
    def is_connected(self) -> bool:
        """The robot has been started and every camera is connected."""
        cameras = all(camera.is_connected for camera in self.cameras.values())
        return self._robot is not None and cameras

    @property
    def is_calibrated(self) -> bool:
        """Return True: the descriptor and the drives have the zero positions."""
        return True

    def calibrate(self) -> None:
        """Do nothing."""

    def configure(self) -> None:
        """Do nothing: the descriptor configures the robot."""

    def connect(self, calibrate: bool = True) -> None:
        """Start the robot, switch its servos on, and open streams. Nothing moves.

        Until ``disconnect`` SIGTERM ends the program as Ctrl-C does, so that LeRobot disconnects.

        Raises:
            DeviceAlreadyConnectedError: it is connected.
            RobotdError: the robot does not start, or its joints are in use.
        """
        if self._robot is not None:
            raise DeviceAlreadyConnectedError(f"{self} is already connected")
        config = self.config
        with ExitStack() as opened:
            opened.enter_context(sigterm_as_interrupt())
            robot = opened.enter_context(
                open_robot(config.descriptor, config.backend, config.variant)
            )
            for camera in self.cameras.values():
                if isinstance(camera, WorldCamera):
                    camera.robot = robot
                camera.connect()
                opened.callback(camera.disconnect)
            streams = [
                opened.enter_context(
                    group.stream(mode=config.mode, timeout_s=config.timeout_s, owner=OWNER)
                )
                for group in robot.groups.values()
            ]
            self._open = opened.pop_all()
        self._robot, self._streams = robot, streams
        if robot.gripper is not None:
            self._gripper = GripperValue(robot.gripper)

    def get_observation(self) -> dict[str, Any]:
        """Return measured positions of one control period, the gripper and the newest images.

        Raises DeviceNotConnectedError before ``connect``.
        """
        robot = self._connected()
        image = robot.image.copy()
        observation: dict[str, Any] = {}
        for key, joint in self._joints.items():
            observation[key] = float(image.position[joint.axis])
        if self._gripper is not None:
            observation[GRIPPER] = self._gripper.position_m
        if self.config.velocities:
            for joint in self._joints.values():
                observation[f"{joint.name}.vel"] = float(image.velocity[joint.axis])
        for name, camera in self.cameras.items():
            observation[name] = camera.read_latest()
        return observation

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Stream the positions, and open or close the gripper, whichever end is nearer.

        Args:
            action: one value for each of ``action_features``.

        Returns:
            The positions that the robot moves to: clipped to its position limits, and to
            ``max_relative_target`` from where it is.

        Raises:
            DeviceNotConnectedError: before ``connect``.
            InvalidArgument: a value is missing, unknown or not finite.
            NotReady: the stream has ended, for example by a fault or a stop; with the reason.
        """
        self._connected()
        if set(action) != set(self.action_features):
            wrong = ", ".join(sorted(set(action) ^ set(self.action_features)))
            raise InvalidArgument(f"action: missing or unknown: {wrong}")
        values = {name: float(value) for name, value in action.items()}
        for name, value in values.items():
            if not math.isfinite(value):  # before the first of several streams moves
                raise InvalidArgument(f"{name} is {value}, must be a finite number")
        values |= self._near(values)
        for stream in self._streams:
            stream.send([values[f"{joint}.pos"] for joint in stream.joints])
        sent = {
            name: min(max(values[name], joint.lower), joint.upper)
            for name, joint in self._joints.items()
        }
        if self._gripper is not None:
            sent[GRIPPER] = self._gripper.move(values[GRIPPER])
        return sent

    def _near(self, values: dict[str, float]) -> dict[str, float]:
        """Return the targets of the joints, not farther away than ``max_relative_target``."""
        position, near = self._connected().image.position, {}
        for name, joint in self._joints.items():
            if (farthest := self._farthest.get(joint.name)) is not None:
                here = float(position[joint.axis])
                near[name] = min(max(values[name], here - farthest), here + farthest)
        return near

    def disconnect(self) -> None:
        """Slow to rest, switch the servos off and close the robot and the cameras.

        Raises DeviceNotConnectedError before ``connect``.
        """
        self._connected()
        self._robot, self._streams = None, []
        self._open.close()

    def _connected(self) -> Robot:
        if self._robot is None:
            raise DeviceNotConnectedError(f"{self} is not connected: call connect() first")
        return self._robot


def _farthest(given: float | dict[str, float] | None, joints: Sequence[str]) -> dict[str, float]:
    """Return ``max_relative_target`` by joint. Raises InvalidArgument: unknown, or not above 0."""
    if given is None:
        return {}
    by_joint = given if isinstance(given, dict) else dict.fromkeys(joints, given)
    for joint, distance in by_joint.items():
        if joint not in joints:
            known = ", ".join(joints)
            raise InvalidArgument(f"max_relative_target: no joint {joint!r} (available: {known})")
        if not distance > 0.0:
            raise InvalidArgument(f"max_relative_target {distance} of {joint}: must be above 0")
    return by_joint
