"""State of a running robot, and commands that need one service call."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import ExitStack, nullcontext
from dataclasses import dataclass

from geometry_msgs.msg import TransformStamped
from robotd_msgs.msg import AxisOwners, IoLevels
from std_msgs.msg import Bool, Float64, String
from tf2_msgs.msg import TFMessage
from wmx_ros2_message.msg import AxisState
from wmx_ros2_message.srv import SetAxis

from robotd.clock import MonotonicClock, wait_until
from robotd.control.groups.problem import Problem
from robotd.errors import DeviceTimeout, InvalidArgument, OperationError, unknown_name
from robotd_ros.client.fleet import RobotIdentity, read_identity
from robotd_ros.client.operator_client import (
    DISCOVERY_S,
    SPEED,
    ProblemListener,
    reason_of_silence,
)
from robotd_ros.client.ros_client import RosClient
from robotd_ros.node_names import IDENTITY, OPERATOR_NODE
from robotd_ros.operator_messages import LEVELS, OWNERS, Levels, read_levels, read_owners
from robotd_ros.qos import LATCHED
from robotd_ros.rotations import roll_pitch_yaw

GRIPPER = "wmx/set_gripper"
HOME_GRIPPER = f"{OPERATOR_NODE}/home_gripper"
HOMING_TIMEOUT_S = 45.0  # longer than that of the robot, which gives the reason
AXIS_NODE = "wmx_core_motion_node"
AXIS_STATE = "wmx/axis/state"
TOOL_POSE = f"{OPERATOR_NODE}/tool_pose"
DESCRIPTION = "robot_description"
EFFORT_UNITS = {"rad": "N·m", "m": "N"}


@dataclass(frozen=True)
class AxisIdentity:
    """Name and unit, ``rad`` or ``m``, of an axis."""

    name: str
    unit: str


@dataclass(frozen=True)
class AxisReport:
    """Measured state of one axis; rad and N·m, or m and N when linear.

    Attributes:
        name: of its joint or wheel.
        unit: ``rad`` or ``m``.
        torque: None where the drive does not report it.
    """

    axis: int
    name: str
    unit: str
    servo_on: bool
    alarm: bool
    home_done: bool
    home_switch: bool
    negative_limit: bool
    positive_limit: bool
    motion_complete: bool
    position_command: float
    position: float
    velocity: float
    torque: float | None

    @property
    def effort(self) -> str:
        """The torque or force for people."""
        return "-" if self.torque is None else f"{self.torque:+z.2f} {EFFORT_UNITS[self.unit]}"


@dataclass(frozen=True)
class ToolReport:
    """Measured pose of the tool.

    Attributes:
        link, base: names of its frame and of the frame that it is given in.
        position_m: x, y, z.
        rotation_rad: roll, pitch, yaw about the fixed axes of ``base``.
        quaternion: the rotation as x, y, z, w.
    """

    link: str
    base: str
    position_m: tuple[float, float, float]
    rotation_rad: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]

    @property
    def lines(self) -> list[str]:
        """The pose for people, in m and degrees."""
        x, y, z = self.position_m
        roll, pitch, yaw = map(math.degrees, self.rotation_rad)
        return [
            f"{self.link} in {self.base}",
            f"x {x:+z.4f}  y {y:+z.4f}  z {z:+z.4f} m",
            f"roll {roll:+z.2f}  pitch {pitch:+z.2f}  yaw {yaw:+z.2f}°",
        ]


@dataclass(frozen=True)
class RobotReport:
    """The robot, its engine and its axes.

    Attributes:
        robot: that answers.
        state: the engine's, in the words of ``get_status``.
        speed: of all motion, 0 to 1; 0 while it is paused.
        problems: what keeps axes from moving, root cause first.
        axes: None where they are not published: the engine is not ready, or the robot runs
            without ``wmx_core_motion_node``.
        owners: client that moves it, by name of the joint; without those that have no owner.
        inputs, outputs: levels by name in the descriptor; None while they are unknown.
        tools: of each joint group; empty for a robot without a URDF, and while positions are not
            known.
    """

    robot: RobotIdentity
    state: str
    ready: bool
    speed: float
    problems: tuple[Problem, ...]
    axes: tuple[AxisReport, ...] | None
    owners: dict[str, str]
    inputs: Levels
    outputs: Levels
    tools: tuple[ToolReport, ...]

    @property
    def takes_motion(self) -> bool:
        """True where neither the engine, a fault nor a stop forbids motion."""
        return self.ready and not any(problem.forbids_motion for problem in self.problems)


def tool_reports(message: TFMessage) -> tuple[ToolReport, ...]:
    """Return the tools of ``TOOL_POSE``."""
    return tuple(map(_tool, message.transforms))


def _tool(message: TransformStamped) -> ToolReport:
    place, turn = message.transform.translation, message.transform.rotation
    return ToolReport(
        message.child_frame_id,
        message.header.frame_id,
        (place.x, place.y, place.z),
        roll_pitch_yaw(turn.x, turn.y, turn.z, turn.w),
        (turn.x, turn.y, turn.z, turn.w),
    )


def read_report(client: RosClient) -> RobotReport:
    """Ask the robot. Raises DeviceTimeout when there is none."""
    with (
        ExitStack() as stack,
        client.listen(Bool, "wmx/engine/ready", LATCHED) as ready,
        client.listen(AxisState, AXIS_STATE) as axes,
        client.listen(String, IDENTITY, LATCHED) as robot,
        client.listen(AxisOwners, OWNERS, LATCHED) as owners,
        client.listen(IoLevels, LEVELS, LATCHED) as io,
        client.listen(TFMessage, TOOL_POSE) as tools,
        client.listen(Float64, SPEED, LATCHED) as speed,
    ):
        problems = ProblemListener(client, stack)
        state = client.trigger("wmx/engine/get_status")
        is_ready = ready.wait().data
        identities = published_axes(client) if is_ready else ()
        reports = axis_reports(axes.wait(), identities) if identities else None
        return RobotReport(
            read_identity(robot.wait().data),
            state,
            is_ready,
            speed.wait().data,
            problems.wait(),
            reports,
            read_owners(owners.wait()),
            *read_levels(io.wait()),
            tool_reports(tools.wait()),
        )


def read_description(client: RosClient) -> str:
    """Return the URDF that a running system publishes. Raises DeviceTimeout without one."""
    with client.listen(String, DESCRIPTION, LATCHED) as description:
        return str(description.wait().data)


def set_gripper(client: RosClient, closed: bool) -> str:
    """The robot's answer. Raises DeviceTimeout without one, OperationError for a rejection."""
    what = "no gripper: a robot offers it whose file has 'gripper' or one of 'servo_grippers'"
    return _ask_gripper(client, GRIPPER, lambda: client.switch(GRIPPER, closed), what)


def home_gripper(client: RosClient) -> str:
    """Home the fingers, which move; the errors are those of ``set_gripper``."""
    client.timeout_s = max(client.timeout_s, HOMING_TIMEOUT_S)
    what = "no gripper to home: a robot offers it whose file has 'gripper'"
    return _ask_gripper(client, HOME_GRIPPER, lambda: client.trigger(HOME_GRIPPER), what)


def _ask_gripper(client: RosClient, service: str, call: Callable[[], str], missing: str) -> str:
    try:
        return call()
    except DeviceTimeout as error:
        if client.node.count_services(service):
            raise
        raise DeviceTimeout(f"{missing} ({error})") from error


def set_servos(client: RosClient, axes: Sequence[str], on: bool) -> str:
    """Switch servos; on, alarms are cleared first.

    Args:
        axes: names, or numbers from 0; empty: all.
        on: False: off.

    Returns what the robot answers for each axis. Raises DeviceTimeout without an answer,
    OperationError when one axis refuses, InvalidArgument for a name that no axis has.
    """
    # To switch off needs no state of the device.
    with reason_of_silence(client) if on else nullcontext():
        names = [axis.name for axis in read_axes(client)]
    index = [_axis_number(axis, names) for axis in axes or names]
    if on:
        client.call(SetAxis, "wmx/axis/clear_alarm", index=index, data=[0] * len(index))
    data = [int(on)] * len(index)
    return str(client.call(SetAxis, "wmx/axis/set_on", index=index, data=data).message)


def read_axes(client: RosClient) -> tuple[AxisIdentity, ...]:
    """Return names and units of the axes. Raises DeviceTimeout without ``wmx_core_motion_node``."""
    names, units = client.parameters(AXIS_NODE, ["axis_names", "axis_units"])
    return tuple(map(AxisIdentity, names, units))


def published_axes(client: RosClient) -> tuple[AxisIdentity, ...]:
    """Return names and units of the axes; empty where their state is not published."""
    # One node of a robot may be discovered before the other.
    is_published = wait_until(
        lambda: client.node.count_publishers(AXIS_STATE) > 0, DISCOVERY_S, MonotonicClock()
    )
    return read_axes(client) if is_published else ()


def axis_reports(message: AxisState, axes: Sequence[AxisIdentity]) -> tuple[AxisReport, ...]:
    """The parallel arrays of the message, axis by axis.

    Raises OperationError: they are not of these axes.
    """
    if len(message.servo_on) != len(axes):
        what = f"{len(message.servo_on)} axes now, {len(axes)} when this command was started"
        raise OperationError(f"the robot has {what}: start it again")
    columns = zip(
        (axis.name for axis in axes),
        (axis.unit for axis in axes),
        message.servo_on,
        message.amp_alarm,
        message.home_done,
        message.home_switch,
        message.negative_ls,
        message.positive_ls,
        message.motion_complete,
        message.pos_cmd,
        message.actual_pos,
        message.actual_velocity,
        (None if math.isnan(torque) else torque for torque in message.actual_torque),
        strict=True,
    )
    return tuple(AxisReport(axis, *values) for axis, values in enumerate(columns))


def _axis_number(axis: str, names: list[str]) -> int:
    if axis in names:
        return names.index(axis)
    if not axis.isdecimal() or int(axis) >= len(names):
        raise InvalidArgument(unknown_name("axis", axis, names))
    return int(axis)
