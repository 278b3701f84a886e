"""Names for authors of kinds of mobile bases.

A kind is a subclass of ``DriveSettings`` in the entry-point group ``robotd.bases``: the model of
the robot's ``drive``, which names the function that makes its kinematics. ``examples/omni_base`` is
a whole one.
"""

from typing import TYPE_CHECKING

from robotd.lazy_names import lazy_names

if TYPE_CHECKING:
    from robotd.descriptor import DriveSettings, OmnidirectionalDrive
    from robotd.descriptor.section import Axis, Name, Positive
    from robotd.motion.planar import PlanarTwist
    from robotd.motion.wheels import BaseKinematics
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "Axis",
    "BaseKinematics",
    "DriveSettings",
    "Name",
    "OmnidirectionalDrive",
    "PlanarTwist",
    "Positive",
]
