"""Poses of the robot's tools: forward kinematics of the measured joint positions."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robotd.arrays import FloatArray
from robotd.descriptor import RobotDescriptor
from robotd.descriptor.urdf import UrdfRobot, read_urdf
from robotd.device.process_image import ProcessImage
from robotd.errors import DescriptorError
from robotd.log import get_logger

log = get_logger("robot")


class ToolPose:
    """Pose of one link in the root of the URDF. Any thread.

    ``axes``: axis of each joint, by name; other joints are at 0.

    Attributes:
        base: root link of the URDF.
    """

    def __init__(self, urdf: UrdfRobot, link: str, axes: Mapping[str, int]) -> None:
        self.base, self.link = urdf.root, link
        self._urdf, self._axes = urdf, dict(axes)

    def frame(self, image: ProcessImage) -> FloatArray | None:
        """Return the frame of the link in ``base``; shape (4, 4), m.

        None while a position is unknown.

        ``image``: a copy, which does not change meanwhile.
        """
        positions = {name: float(image.position[axis]) for name, axis in self._axes.items()}
        frame = self._urdf.pose(self.link, positions)
        return frame if np.isfinite(frame).all() else None


def tool_poses(descriptor: RobotDescriptor) -> tuple[ToolPose, ...]:
    """Return the tool of each joint group.

    It is the ``tool_link`` of the group, or the link that its last joint moves.
    Empty without joints or a URDF; also where it cannot be used, which is logged.
    """
    path = descriptor.urdf
    if path is None or not descriptor.joints:
        return ()
    axes = {joint.name: joint.axis for joint in descriptor.joints}
    try:
        urdf = read_urdf(path)
        links = [tool_link(urdf, descriptor, group) for group in descriptor.joint_groups]
    except DescriptorError as error:
        log.warning("no pose of the tool", reason=str(error))
        return ()
    return tuple(ToolPose(urdf, link, axes) for link in links)


def tool_link(urdf: UrdfRobot, descriptor: RobotDescriptor, group: str) -> str:
    """Return the link of a group's tool: ``tool_link``, or that of its last joint.

    Raises DescriptorError: ``urdf``, that of the descriptor, has no such joint or link.
    """
    path, last = descriptor.urdf, descriptor.joint_groups[group][-1].name
    if last not in urdf.joint:
        raise DescriptorError(f"has no joint {last!r}", path=path)
    link = descriptor.tool_links.get(group, urdf.joint[last].child)
    if link not in urdf.links:
        raise DescriptorError(f"has no link {link!r}", path=path)
    return link
