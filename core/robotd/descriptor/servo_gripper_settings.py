"""Grippers that are a joint of the robot."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from pydantic import Field

from robotd.descriptor.joint_settings import JointSettings
from robotd.descriptor.section import Name, Positive, Problem, Section


class ServoGripperSettings(Section):
    """A gripper whose fingers a joint of the robot moves; positions are those of the joint."""

    joint: Name = Field(description="Joint that moves the fingers.")
    open_position: float = Field(description="Position of the joint when open, rad or m.")
    closed_position: float = Field(description="Position of the joint when closed, rad or m.")
    squeeze: Positive = Field(
        description="Way by which the command leads the fingers while they hold a part, rad or m:"
        " they press with the force that the servo has for such an error."
    )

    def problems(self) -> Iterator[Problem]:
        if self.open_position == self.closed_position:
            yield ("closed_position",), "must differ from open_position", self.closed_position


def servo_gripper_problems(
    grippers: Mapping[str, ServoGripperSettings], joints: Sequence[JointSettings]
) -> Iterator[Problem]:
    """Yield what is wrong between ``servo_grippers`` and the joints of the robot."""
    known, used = {joint.name: joint for joint in joints}, dict[str, str]()
    for name, gripper in grippers.items():
        joint = known.get(gripper.joint)
        if joint is None:
            available = ", ".join(known) or "none"
            what = f"unknown joint (available: {available})"
            yield ("servo_grippers", name, "joint"), what, gripper.joint
            continue
        if gripper.joint in used:
            what = f"is the joint of {used[gripper.joint]} already"
            yield ("servo_grippers", name, "joint"), what, gripper.joint
        used[gripper.joint] = name
        for key in ("open_position", "closed_position"):
            position = getattr(gripper, key)
            if not joint.lower <= position <= joint.upper:
                what = f"must be within the limits of {joint.name}, {joint.lower} to {joint.upper}"
                yield ("servo_grippers", name, key), what, position
