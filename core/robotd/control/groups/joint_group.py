"""Groups of joints: what clients hold of one, its goals, streams and stops."""

from __future__ import annotations

from collections.abc import Iterable

from robotd.control.groups.joint_motion import STOP_TIMEOUT_S, JointMotion
from robotd.control.groups.joint_stream import JointStreams
from robotd.control.groups.torque_stream import TorqueStreams
from robotd.control.groups.trajectory_follower import TrajectoryFollower
from robotd.control.loop.rearming import Rearming
from robotd.control.loop.setpoint_mixer import SetpointMixer, SourceSlot
from robotd.descriptor import RobotDescriptor
from robotd.device.axes import Axes
from robotd.device.drivers import AxisDriver
from robotd.device.motion_limits import MotionLimits
from robotd.device.process_image import ProcessImage
from robotd.device.state import Operation
from robotd.errors import InvalidArgument, Unsupported, unknown_name

ON_DEVICE = "several joint groups with trajectories that the device interpolates"


class JointGroup:
    """Joints that are claimed, moved and stopped together.

    A goal or stream of one group does not affect those of another one. All groups share the
    device, the control loop, the speed, and the stop of all motion.

    Attributes:
        name: of the group.
        joint_names, joint_axes: names and axes, in the order of the group's commands.
        motion_limits: of the motion of all joints together, for features.
        motion: hands the joints from one setpoint source to the next.
        follower: executes trajectories of ``joint_names``.
        stream: opens a stream of some of the joints.
        torque_stream: opens a torque stream of some of the joints.
    """

    def __init__(
        self,
        name: str,
        descriptor: RobotDescriptor,
        axes: Axes,
        slot: SourceSlot,
        driver: AxisDriver,
        rearming: Rearming,
    ) -> None:
        self.name = name
        self.joint_names = descriptor.joint_names
        self.joint_axes = tuple(joint.axis for joint in descriptor.joints)
        self.motion_limits = MotionLimits(self.joint_axes)
        axes.motion_limits.append(self.motion_limits)
        self.motion = JointMotion(axes, slot, self.joint_axes)
        on_device = driver if axes.trajectories_on_device else None
        self.follower = TrajectoryFollower(
            self.motion, axes, descriptor, self.motion_limits, on_device
        )
        limits, rules = self.follower.limits, self.follower.rules
        joints = self.motion, limits, rules, self.motion_limits, axes, rearming, descriptor, driver
        self.stream, self.torque_stream = JointStreams(*joints), TorqueStreams(*joints)

    def moved_by_device(self, image: ProcessImage) -> list[int]:
        """Return the axes that a move, a jog or a homing moves, by the device's own profile."""
        by_device = (Operation.POSITION, Operation.VELOCITY, Operation.HOMING)
        operations = image.operation.tolist()
        return [axis for axis in self.joint_axes if operations[axis] in by_device]


class JointGroups(dict[str, JointGroup]):
    """Groups of a robot by name; every joint is in one. Any thread.

    Args:
        descriptor, axes, driver, rearming: of the robot, with all joints.
        mixer: makes a slot for each group.
    Raises Unsupported: there are several and the device interpolates trajectories itself.
    """

    def __init__(
        self,
        descriptor: RobotDescriptor,
        axes: Axes,
        mixer: SetpointMixer,
        driver: AxisDriver,
        rearming: Rearming,
    ) -> None:
        super().__init__()
        groups = descriptor.joint_groups
        if len(groups) > 1 and axes.trajectories_on_device:
            raise Unsupported(ON_DEVICE, axes.backend)
        for name, joints in groups.items():
            part = descriptor.model_copy(update={"joints": joints})
            self[name] = JointGroup(name, part, axes, mixer.slot(), driver, rearming)

    @property
    def only(self) -> JointGroup:
        """The group of all joints. Raises InvalidArgument where there are several groups."""
        if len(self) == 1:
            return next(iter(self.values()))
        names = ", ".join(self)
        raise InvalidArgument(f"the joints are in several groups: use groups[...] ({names})")

    def of(self, joints: Iterable[str]) -> JointGroup:
        """Return the group that has all of ``joints``.

        Raises InvalidArgument: an unknown joint, or joints of several groups.
        """
        if len(self) == 1:
            return self.only
        group_of = {joint: group for group in self.values() for joint in group.joint_names}
        found: dict[str, str] = {}  # group: its first joint among those asked for
        for joint in joints:
            if joint not in group_of:
                raise InvalidArgument(unknown_name("joint", joint, group_of))
            found.setdefault(group_of[joint].name, joint)
        if len(found) != 1:
            names = ", ".join(f"{joint} in {group}" for group, joint in found.items())
            raise InvalidArgument(f"joints of one group must be given, not {names or 'none'}")
        return self[next(iter(found))]

    def stop(self, timeout_s: float = STOP_TIMEOUT_S) -> None:
        """Stop all groups at the same time, along their paths, and wait for standstill.

        After ``timeout_s`` of a group it returns while joints may still move.
        """
        for group in self.values():
            group.motion.cancel()
        for group in self.values():
            group.motion.stop(timeout_s)
