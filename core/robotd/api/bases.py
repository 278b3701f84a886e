"""Names for authors of kinds of mobile bases.

A kind is a subclass of ``DriveSettings`` in the entry-point group ``robotd.bases``: the model of
the robot's ``drive``, which names the function that makes its kinematics. robotd's own kinds are in
``robotd_bases``; ``examples/omni_base`` is a whole one.
"""

from typing import TYPE_CHECKING

from robotd.lazy_names import lazy_names

if TYPE_CHECKING:
    from robotd.descriptor import DriveSettings, OmnidirectionalDrive, SteeringAxis
    from robotd.descriptor.base_kinds import base_kind
    from robotd.descriptor.section import Axis, Key, Name, Positive
    from robotd.descriptor.section import Problem as SectionProblem
    from robotd.motion.base_kinematics import BaseKinematics, SteeredKinematics, WheelFollower
    from robotd.motion.planar import PlanarTwist
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "Axis",
    "BaseKinematics",
    "DriveSettings",
    "Key",
    "Name",
    "OmnidirectionalDrive",
    "PlanarTwist",
    "Positive",
    "SectionProblem",
    "SteeredKinematics",
    "SteeringAxis",
    "WheelFollower",
    "base_kind",
]
