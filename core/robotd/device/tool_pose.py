"""Pose of the robot's tool: forward kinematics of the measured joint positions."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Self

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

    Args:
        urdf: of the robot.
        link: name of the link.
        axes: axis of each joint, by name; other joints are at 0.
        image: live process image.

    Attributes:
        base: root link of the URDF.
        link: name of the link.
    """

    def __init__(
        self, urdf: UrdfRobot, link: str, axes: Mapping[str, int], image: ProcessImage
    ) -> None:
        self.base, self.link = urdf.root, link
        self._urdf, self._image = urdf, image
        self._axes = dict(axes)

    @classmethod
    def of_robot(cls, descriptor: RobotDescriptor, image: ProcessImage) -> Self | None:
        """Return the pose of ``tool_link``, by default of the link that the last joint moves.

        None without joints or a URDF; also where it cannot be used, which is logged.
        """
        if descriptor.urdf is None or not descriptor.joints:
            return None
        try:
            urdf = read_urdf(descriptor.urdf)
            link = _link(urdf, descriptor, descriptor.urdf)
        except DescriptorError as error:
            log.warning("no pose of the tool", reason=str(error))
            return None
        return cls(urdf, link, {each.name: each.axis for each in descriptor.joints}, image)

    def frame(self) -> FloatArray | None:
        """Return the frame of the link in ``base``; shape (4, 4), m.

        None while a position is unknown.
        """
        position = self._image.copy().position
        frame = self._urdf.pose(
            self.link, {name: float(position[axis]) for name, axis in self._axes.items()}
        )
        return frame if np.isfinite(frame).all() else None


def _link(urdf: UrdfRobot, descriptor: RobotDescriptor, path: Path) -> str:
    last = descriptor.joints[-1].name
    if last not in urdf.joint:
        raise DescriptorError(f"has no joint {last!r}", path=path)
    link = descriptor.tool_link or urdf.joint[last].child
    if link not in urdf.links:
        raise DescriptorError(f"has no link {link!r}", path=path)
    return link
