"""Poses of a robot by name: saved where the joints are, and gone to."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import TypeVar

import numpy as np

from robotd.api import FloatArray, InvalidArgument, unknown_name
from robotd.api.robots import JointGroup, Robot, TrajectoryRequest
from robotd_shared.pose_file import (
    PoseFile,
    SavedToolPose,
    check_name,
    file_of,
    read_pose_file,
    read_poses,
    write_poses,
)
from robotd_teach.joint_groups import (
    beyond_limits,
    follow,
    group_of,
    joint_group,
    measured_positions,
)
from robotd_teach.tool_poses import tool_change, tool_pose_at
from robotd_tool_space.geometry.rotations import inverse_pose
from robotd_tool_space.tool_groups import ToolGroups

SPEED = 0.2  # of the joints' limits
SLOWEST = 0.01
SHORTEST_S = 0.1
# Peaks of speed and acceleration of a cubic from rest to rest, per distance / time and / time².
CUBIC_VELOCITY, CUBIC_ACCELERATION = 1.5, 6.0

Item = TypeVar("Item")


class Poses:
    """Poses of a robot: ``robot.feature(Poses)``. Any worker thread.

    A pose has the positions of the joints of one group, rad or m, and where the arm has
    kinematics the pose of its tool. The file is read for each question, so that what a person edits
    counts at once.

    Attributes:
        path: of the file.
        on_change: called after each change, in the thread that made it.
    """

    def __init__(self, robot: Robot) -> None:
        self.path = file_of(robot.descriptor)
        self.on_change: Callable[[], None] = lambda: None
        self._robot = robot
        self._lock = threading.Lock()  # of the file

    def all(self) -> Mapping[str, Mapping[str, float]]:
        """Return positions by joint, by pose. Raises DescriptorError: the file is wrong."""
        return read_poses(self.path)

    def tool_poses(self) -> Mapping[str, SavedToolPose]:
        """Return the pose of the tool, by pose, of those that have one. Raises DescriptorError."""
        return read_pose_file(self.path).tool_poses

    def problems(self) -> Mapping[str, str]:
        """Return why each pose cannot be gone to; "": nothing is known against it.

        Raises DescriptorError: the file is wrong.
        """
        file = read_pose_file(self.path)
        return {name: self._problem(file, name) for name in file.poses}

    def save(self, name: str, group: str = "", *, replace: bool = False) -> Mapping[str, float]:
        """Save where the joints of a group are now, and return it. Nothing moves.

        Args:
            name: of the pose.
            group: joint group; "": the only one.
            replace: a pose of this name is replaced.

        Raises:
            InvalidArgument: no name, the name is taken, or no such group.
            NotReady: a position is not known.
            DescriptorError: the file is wrong. OSError: it cannot be written.
        """
        check_name(name)
        joints = joint_group(self._robot, group)
        self._robot.connection.require_ready()
        positions = measured_positions(self._robot, joints)
        with self._lock:
            file = read_pose_file(self.path)
            poses, tool_poses = file.poses, file.tool_poses
            if name in poses and not replace:
                raise InvalidArgument(f"there is a pose {name!r} already: replace it, or rename it")
            poses[name] = dict(zip(joints.joint_names, positions.tolist(), strict=True))
            tool_poses.pop(name, None)
            if (tool_pose := tool_pose_at(self._robot, joints, positions)) is not None:
                tool_poses[name] = tool_pose
            write_poses(self.path, poses, tool_poses)
        self.on_change()
        return poses[name]

    def rename(self, name: str, new: str) -> None:
        """Give a pose another name. Raises InvalidArgument: unknown, taken, or no name."""
        check_name(new)
        with self._lock:
            file = self._known(name)
            if new in file.poses:
                raise InvalidArgument(f"there is a pose {new!r} already")
            poses = _renamed(file.poses, name, new)
            write_poses(self.path, poses, _renamed(file.tool_poses, name, new))
        self.on_change()

    def delete(self, name: str) -> None:
        """Delete a pose. Raises InvalidArgument: unknown."""
        with self._lock:
            file = self._known(name)
            del file.poses[name]
            write_poses(self.path, file.poses, file.tool_poses)
        self.on_change()

    def known(self, name: str) -> Mapping[str, float]:
        """Return the positions of a pose by joint. Raises InvalidArgument: unknown."""
        return self._known(name).poses[name]

    def go(self, name: str, speed: float = SPEED, *, line: bool = False) -> None:
        """Move to a pose, and return at rest there.

        Args:
            name: of the pose.
            speed: 0.01 to 1 of the velocity and acceleration limits of the joints; with ``line`` of
                the speed of the tool.
            line: the chosen tool moves on a straight line to where it is with the joints there.

        Raises:
            InvalidArgument: unknown, cannot be gone to, or a wrong speed; nothing has moved.
            NotReady, TrajectoryRejected: the joints cannot be commanded; nothing has moved.
            Unsupported, DescriptorError: ``line`` of an arm without kinematics.
            OperationError: the motion ended elsewhere, with the reason.
        """
        group, request = self.plan(name, speed)
        if not line:
            follow(self._robot, group, request, f"to {name}")
            return
        tool = self._robot.feature(ToolGroups).of(group.name)
        pose = tool.kinematics.forward(request.positions[-1])
        tool.move_line(inverse_pose(tool.work_frame) @ pose, speed=speed)

    def plan(self, name: str, speed: float = SPEED) -> tuple[JointGroup, TrajectoryRequest]:
        """Return the joints of a pose and their motion to it; see ``go``. Nothing moves."""
        if not SLOWEST <= speed <= 1.0:
            raise InvalidArgument(f"speed is {speed:g}, must be {SLOWEST:g} to 1")
        file = self._known(name)
        if problem := self._problem(file, name):
            raise InvalidArgument(problem)
        group = group_of(self._robot, file.poses[name])
        limits, target = group.follower.limits, _positions(group, file.poses[name])
        distance = np.abs(target - measured_positions(self._robot, group))
        fast = CUBIC_VELOCITY * distance / (speed * limits.velocity)
        hard = np.sqrt(CUBIC_ACCELERATION * distance / (speed * limits.acceleration))
        seconds = np.array([max(*fast, *hard, SHORTEST_S)])
        return group, TrajectoryRequest(group.joint_names, seconds, target[None])

    def _problem(self, file: PoseFile, name: str) -> str:
        joints, tool_pose = file.poses[name], file.tool_poses.get(name)
        try:
            group = group_of(self._robot, joints)
        except InvalidArgument as error:
            return str(error)
        positions = _positions(group, joints)
        problem = beyond_limits(group.follower.limits, positions)
        if problem or tool_pose is None:
            return problem
        return tool_change(self._robot, group, positions, tool_pose)

    def _known(self, name: str) -> PoseFile:
        """Return the file. Raises InvalidArgument: no pose is called ``name``."""
        file = read_pose_file(self.path)
        if name not in file.poses:
            raise InvalidArgument(unknown_name("pose", name, file.poses))
        return file


def _renamed(items: Mapping[str, Item], name: str, new: str) -> dict[str, Item]:
    return {new if key == name else key: item for key, item in items.items()}


def _positions(group: JointGroup, joints: Mapping[str, float]) -> FloatArray:
    return np.array([joints[joint] for joint in group.joint_names], np.float64)
