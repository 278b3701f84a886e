"""wmx_robot_option_node: motion of the whole robot by the services of WMX R2, and its status.

Units of WMX R2 are mm and degrees; poses are x, y, z and roll, pitch, yaw (u, v, w).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from wmx_r2_message.msg import RobotStatus
from wmx_r2_message.srv import (
    RobotGetCoordinate,
    RobotId,
    RobotOverrideVelocityByRatio,
    RobotSetCoordinate,
    RobotSetRobotParam,
    RobotStartMotion,
)

from robotd.api import FloatArray, InvalidArgument, NotReady, ProcessImage
from robotd.api.robots import Robot
from robotd_ros.api import RosHost, add_service, read_settings
from robotd_ros.nodes.latched_topics import publish_if_alive
from robotd_tool_space.geometry.rotations import inverse_pose, pose_of, rpy_of
from robotd_tool_space.nodes.node_settings import RobotOptionSettings, read_robot_option
from robotd_tool_space.nodes.r2_motion import R2Motion, R2Request
from robotd_tool_space.paths.tool_motion import ToolMotion
from robotd_tool_space.robot_tool import BASE, TOOL, RobotTool
from robotd_tool_space.tool_groups import ToolGroups

NAME = "wmx_robot_option_node"
PREFIX = "wmx/robot/"
# Of a RobotStartMotion.
CHOICES = ("mode", "frame", "target_type", "path")  # fields that are 0 or 1
RELATIVE, JOINTS, LINE = 1, 0, 1  # of mode, target_type and path
POSTURE = ("s", "e", "r")
TOPIC = "wmx/robot/status"
DEPTH = 1
MM_M = 1e-3
FACTORS = {"rad": np.pi / 180.0, "m": MM_M}


class WmxRobotOptionNode(Node):
    """Services of one robot, which is a joint group with a tool, and its status.

    A service answers when its request is carried out or has begun; the end of a motion shows in
    the status.

    Raises:
        DescriptorError: a parameter is wrong, or the URDF has no chain to the tool.
        Unsupported: the robot has no URDF.
    """

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__(NAME, context=host.context)
        settings = read_settings(self, robot.descriptor, read_robot_option)
        self._descriptor, self._id = robot.descriptor, settings.robot_id
        self._tool = robot.feature(ToolGroups).of(settings.group)
        _ = self._tool.kinematics.task  # takes a while: not at the first request
        self._motion = R2Motion(robot, self._tool, host.submit)
        self._status = R2StatusTopic(self, robot, self._tool, self._motion, settings)
        for service_type, name, handler in (
            (RobotSetRobotParam, "set_robot_param", self._register),
            (RobotId, "release_robot", self._release),
            (RobotId, "clear_motion_error", self._clear_error),
            (RobotId, "release_e_stop", self._release_e_stop),
            (RobotOverrideVelocityByRatio, "override_velocity_by_ratio", self._override),
            (RobotSetCoordinate, "set_tool_coordinate", self._set_tool),
            (RobotGetCoordinate, "get_tool_coordinate", self._get_tool),
        ):
            add_service(self, host, service_type, f"{PREFIX}{name}", handler)
        start, arrive = f"{PREFIX}start_motion", self._motion.arrive
        add_service(self, host, RobotStartMotion, start, self._start, on_arrival=arrive)
        add_service(self, host, RobotId, f"{PREFIX}stop_motion", self._stop, urgent=True)
        add_service(self, host, RobotId, f"{PREFIX}e_stop", self._e_stop, urgent=True)

    def _register(self, request: Any, response: Any) -> str:
        """Take the robot up again; its model is that of the descriptor."""
        if request.param_file:
            if Path(request.param_file) != self._descriptor.urdf:
                raise InvalidArgument(
                    f"param_file {request.param_file!r}: the model of {self._descriptor.name} is"
                    f" that of its robot.yaml; leave it empty, or name {self._descriptor.urdf}"
                )
            self._check_id(request.robot_id)
        self._status.is_active = True
        response.robot_id, response.num_joints = self._id, len(self._tool.group.joint_names)
        return f"robot {self._descriptor.name} has the id {self._id}"

    def _release(self, request: Any, response: Any) -> str:
        self._require(request.robot_id)
        if self._motion.moves:
            raise NotReady("the robot moves: stop_motion first")
        self._status.is_active = False
        return "released; set_robot_param takes it up again"

    def _start(self, arrived: R2Request, response: Any) -> str:
        request = arrived.request
        self._require(request.robot_id)
        is_line = request.path == LINE
        return self._motion.start(lambda: planned(self._tool, request), arrived, is_line=is_line)

    def _stop(self, request: Any, response: Any) -> str:
        """Stop, also a robot that was released: something else may move it."""
        self._check_id(request.robot_id)
        self._motion.stop()
        return "stopping"

    def _e_stop(self, request: Any, response: Any) -> str:
        """Stop as fast as the drives can, also a robot that was released."""
        self._check_id(request.robot_id)
        self._motion.e_stop()
        return "all motion is stopped until release_e_stop"

    def _release_e_stop(self, request: Any, response: Any) -> str:
        self._require(request.robot_id)
        return self._motion.release_e_stop()

    def _clear_error(self, request: Any, response: Any) -> str:
        self._require(request.robot_id)
        return self._motion.clear_error()

    def _override(self, request: Any, response: Any) -> str:
        self._require(request.robot_id)
        self._motion.override(
            vel_ratio=request.vel_ratio, acc_ratio=request.acc_ratio, dec_ratio=request.dec_ratio
        )
        return f"{100.0 * request.vel_ratio:g} % until the motion ends; accelerations follow"

    def _set_tool(self, request: Any, response: Any) -> str:
        self._require(request.robot_id)
        self._tool.set_tool(pose_of_r2(request.pose))
        return f"tool set in {self._tool.link}"

    def _get_tool(self, request: Any, response: Any) -> str:
        self._require(request.robot_id)
        fill_r2_pose(response.pose, self._tool.tool_frame)
        return self._tool.tool_name or self._tool.link

    def _require(self, robot_id: int) -> None:
        self._check_id(robot_id)
        if not self._status.is_active:
            raise NotReady("no robot is registered: set_robot_param first")

    def _check_id(self, robot_id: int) -> None:
        if robot_id != self._id:
            raise InvalidArgument(f"robot_id is {robot_id}, this node serves {self._id}")


def planned(tool: RobotTool, request: Any) -> ToolMotion:
    """Return the motion that a request asks for.

    Raises InvalidArgument, Unreachable; NotReady: the joints move.
    """
    for field in CHOICES:
        if (value := getattr(request, field)) not in (0, 1):
            raise InvalidArgument(f"{field} is {value}, must be 0 or 1")
    if request.target_type == JOINTS:
        if request.path == LINE:
            raise InvalidArgument("a line (path 1) needs a pose (target_type 1), not joints")
        return tool.plan_joints(_joint_target(tool, request))
    pose = pose_of_r2(request.target_pose)
    if request.mode == RELATIVE:
        pose = tool.relative(pose, TOOL if request.frame else BASE)
    if request.path == LINE:
        return tool.plan_lines([pose])
    for field in POSTURE:
        if value := getattr(request, field):
            text = f"{field} is {value}, must be 0: of the postures that of the shortest way is"
            raise InvalidArgument(f"{text} taken; name another one by its joints (target_type 0)")
    return tool.plan_move(pose)


def _joint_target(tool: RobotTool, request: Any) -> FloatArray:
    factors = r2_factors(tool.kinematics.units)
    target = joints_of_r2(request.target_joint, tool.group.joint_names, factors)
    return tool.start() + target if request.mode == RELATIVE else target


def pose_of_r2(message: Any) -> FloatArray:
    """Return a RobotCartesianPose as a pose (4, 4), m. Raises InvalidArgument: not finite."""
    for component in "xyzuvw":
        if not np.isfinite(value := getattr(message, component)):
            raise InvalidArgument(f"{component} of the pose is {value}, must be a finite number")
    place = np.array([message.x, message.y, message.z])
    return pose_of(MM_M * place, np.radians([message.u, message.v, message.w]))


def fill_r2_pose(message: Any, pose: FloatArray) -> None:
    """Set a RobotCartesianPose to a pose (4, 4), m. At a pitch of a quarter turn u is 0."""
    message.x, message.y, message.z = map(float, pose[:3, 3] / MM_M)
    message.u, message.v, message.w = map(float, np.degrees(rpy_of(pose)))


def r2_factors(units: Sequence[str]) -> FloatArray:
    """Return what a degree or mm of each joint is, (n,), in its unit, rad or m."""
    return np.array([FACTORS[unit] for unit in units])


def joints_of_r2(values: Sequence[float], names: Sequence[str], factors: FloatArray) -> FloatArray:
    """Return positions (n,), rad or m, of values in degrees or mm.

    Args:
        values: one for each joint.
        factors: see ``r2_factors``.

    Raises InvalidArgument: another number of values, or one that is not finite.
    """
    if len(values) != len(names):
        raise InvalidArgument(f"target_joint has {len(values)} values for {len(names)} joints")
    for name, value in zip(names, values, strict=True):
        if not np.isfinite(value):
            raise InvalidArgument(f"target_joint of {name} is {value}, must be a finite number")
    return np.array(values) * factors


class R2StatusTopic:
    """Publishes the status while it has subscribers and the positions are known. Executor thread.

    Attributes:
        is_active: the robot is registered; without one nothing is published. Any thread writes it.
    """

    def __init__(
        self,
        node: Node,
        robot: Robot,
        tool: RobotTool,
        motion: R2Motion,
        settings: RobotOptionSettings,
    ) -> None:
        self.is_active = True
        self._robot, self._tool, self._motion, self._settings = robot, tool, motion, settings
        self._axes = list(tool.group.joint_axes)
        self._factors = r2_factors(tool.kinematics.units)
        self._clock = node.get_clock()
        self._publisher = node.create_publisher(RobotStatus, TOPIC, DEPTH)
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # no clock jump stops it
        self._timer = node.create_timer(1.0 / settings.status_hz, self._publish, clock=steady)

    def _publish(self) -> None:
        if not (self.is_active and self._publisher.get_subscription_count()):
            return
        image = self._robot.image.copy()
        if self._robot.connection.ready and np.isfinite(image.position[self._axes]).all():
            publish_if_alive(self._publisher, self._message(image))

    def _message(self, image: ProcessImage) -> RobotStatus:
        settings, tool, axes = self._settings, self._tool, self._axes
        message = RobotStatus(robot_id=settings.robot_id)
        message.header.stamp = self._clock.now().to_msg()
        message.header.frame_id = settings.prefix + (tool.work_frame_name or tool.base)
        state, fault = self._motion.state(image)
        message.motion_state, message.motion_error_code = int(state), int(fault.code)
        message.motion_error_joint = fault.joint
        base, kinematics = inverse_pose(tool.work_frame), tool.kinematics
        for suffix, positions, velocities in (
            ("cmd", image.position_command[axes], image.velocity_command[axes]),
            ("fb", image.position[axes], image.velocity[axes]),
        ):
            fill_r2_pose(
                getattr(message, f"tool_pose_{suffix}"), base @ kinematics.forward(positions)
            )
            setattr(message, f"joint_pos_{suffix}", (positions / self._factors).tolist())
            setattr(message, f"joint_velocity_{suffix}", (velocities / self._factors).tolist())
        message.joint_torque_fb = image.torque[axes].tolist()
        return message
