"""Poses of a robot by name: saved where the joints are, and gone to."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping

import numpy as np

from robotd.api import InvalidArgument, unknown_name
from robotd.api.robots import JointGroup, Robot, TrajectoryRequest
from robotd_shared.pose_file import check_name, file_of, read_poses, write_poses
from robotd_teach.joint_groups import (
    beyond_limits,
    follow,
    group_of,
    joint_group,
    measured_positions,
)

SPEED = 0.2  # of the joints' limits
SLOWEST = 0.01
SHORTEST_S = 0.1
# Peaks of speed and acceleration of a cubic from rest to rest, in way by time and by its square.
CUBIC_VELOCITY, CUBIC_ACCELERATION = 1.5, 6.0


class Poses:
    """Poses of a robot: ``robot.feature(Poses)``. Any worker thread.

    A pose has the positions of the joints of one group, rad or m. The file is read for each
    question, so that what a person edits counts at once.

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
            poses = read_poses(self.path)
            if name in poses and not replace:
                raise InvalidArgument(f"there is a pose {name!r} already: replace it, or rename it")
            poses[name] = dict(zip(joints.joint_names, positions.tolist(), strict=True))
            write_poses(self.path, poses)
        self.on_change()
        return poses[name]

    def rename(self, name: str, new: str) -> None:
        """Give a pose another name. Raises InvalidArgument: unknown, taken, or no name."""
        check_name(new)
        with self._lock:
            poses = self._known(name)
            if new in poses:
                raise InvalidArgument(f"there is a pose {new!r} already")
            changed = {new if key == name else key: joints for key, joints in poses.items()}
            write_poses(self.path, changed)
        self.on_change()

    def delete(self, name: str) -> None:
        """Delete a pose. Raises InvalidArgument: unknown."""
        with self._lock:
            poses = self._known(name)
            del poses[name]
            write_poses(self.path, poses)
        self.on_change()

    def known(self, name: str) -> Mapping[str, float]:
        """Return the positions of a pose by joint. Raises InvalidArgument: unknown."""
        return self._known(name)[name]

    def problem(self, joints: Mapping[str, float]) -> str:
        """Return why a pose cannot be gone to; "": nothing is known against it."""
        try:
            group = group_of(self._robot, joints)
        except InvalidArgument as error:
            return str(error)
        positions = np.array([joints[joint] for joint in group.joint_names])
        return beyond_limits(group.follower.limits, positions)

    def duration_s(self, joints: Mapping[str, float], speed: float = SPEED) -> float:
        """Return how long the joints take from where they are, at a part of their limits.

        Raises InvalidArgument: the pose cannot be gone to, or the speed is not 0.01 to 1; NotReady:
        it is not known where the joints are.
        """
        if not SLOWEST <= speed <= 1.0:
            raise InvalidArgument(f"speed is {speed:g}, must be {SLOWEST:g} to 1")
        if problem := self.problem(joints):
            raise InvalidArgument(problem)
        group = group_of(self._robot, joints)
        limits, target = group.follower.limits, [joints[joint] for joint in group.joint_names]
        way = np.abs(target - measured_positions(self._robot, group))
        fast = CUBIC_VELOCITY * way / (speed * limits.velocity)
        hard = np.sqrt(CUBIC_ACCELERATION * way / (speed * limits.acceleration))
        return float(max(*fast, *hard, SHORTEST_S))

    def go(self, name: str, speed: float = SPEED) -> None:
        """Move to a pose, and return at rest there.

        Args:
            name: of the pose.
            speed: 0.01 to 1 of the velocity and acceleration limits of the joints.

        Raises:
            InvalidArgument: unknown, cannot be gone to, or a wrong speed; nothing has moved.
            NotReady, TrajectoryRejected: the joints cannot be commanded; nothing has moved.
            OperationError: the motion ended elsewhere, with the reason.
        """
        group, request = self.plan(name, speed)
        follow(self._robot, group, request, f"to {name}")

    def plan(self, name: str, speed: float = SPEED) -> tuple[JointGroup, TrajectoryRequest]:
        """Return the joints of a pose and their motion to it; see ``go``. Nothing moves."""
        joints = self.known(name)
        seconds, group = self.duration_s(joints, speed), group_of(self._robot, joints)
        target = np.array([[joints[joint] for joint in group.joint_names]])
        return group, TrajectoryRequest(group.joint_names, np.array([seconds]), target)

    def _known(self, name: str) -> dict[str, dict[str, float]]:
        """Return all poses. Raises InvalidArgument: none is called ``name``."""
        poses = read_poses(self.path)
        if name not in poses:
            raise InvalidArgument(unknown_name("pose", name, poses))
        return poses
