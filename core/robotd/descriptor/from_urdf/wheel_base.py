"""Differential base of a URDF: its two wheels, their radius and distance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from robotd.descriptor.urdf import UrdfJoint, UrdfRobot
from robotd.errors import DescriptorError

DEFAULT_WHEEL_VELOCITY_RAD_S = 10.0
SAME_RADIUS = 0.01  # part by which the wheels may differ
MIN_SEPARATION_M = 1e-3
FOOTPRINT = "base_footprint"


@dataclass(frozen=True)
class WheelBase:
    """Two driven wheels.

    Attributes:
        joints: of the left and the right wheel.
        frame: link that moves as the base does.
        velocity_rad_s: of a wheel.
        is_assumed: the URDF has no speed, and ``velocity_rad_s`` is the default.
    """

    joints: tuple[UrdfJoint, UrdfJoint]
    frame: str
    radius_m: float
    separation_m: float
    velocity_rad_s: float
    is_assumed: bool


def wheel_base(
    urdf: UrdfRobot, wheels: Sequence[UrdfJoint], radius_m: float | None, path: Path
) -> WheelBase:
    """Return the base on two wheels; y is to the left (REP 103).

    Raises DescriptorError: not two wheels, both on one side, or no radius.
    """
    if len(wheels) != 2 or wheels[0] is wheels[1]:
        raise DescriptorError("a differential base has two wheels, LEFT,RIGHT", path=path)
    sides = [float(urdf.pose(joint.child, {})[1, 3]) for joint in wheels]
    left, right = wheels if sides[0] > sides[1] else wheels[::-1]
    separation_m = abs(sides[0] - sides[1])
    if separation_m < MIN_SEPARATION_M:
        what = (
            f"the wheels {left.name} and {right.name} are on one side, at y {sides[0]:g} m:"
            " y of the base must point to the left"
        )
        raise DescriptorError(what, path=path, line=left.line, key=left.name)
    known = [joint.velocity for joint in (left, right) if joint.velocity is not None]
    return WheelBase(
        (left, right),
        FOOTPRINT if FOOTPRINT in urdf.links else left.parent,
        radius_m or _radius(urdf, left, right, path),
        separation_m,
        min(known, default=DEFAULT_WHEEL_VELOCITY_RAD_S),
        not known,
    )


def _radius(urdf: UrdfRobot, left: UrdfJoint, right: UrdfJoint, path: Path) -> float:
    radii = [urdf.links[joint.child].radius for joint in (left, right)]
    for joint, radius in zip((left, right), radii, strict=True):
        if not radius:
            what = (
                f"link {joint.child!r} has no cylinder or sphere that gives the wheel's radius:"
                " pass --wheel-radius METRES"
            )
            raise DescriptorError(what, path=path, line=joint.line, key=joint.name)
    low, high = sorted(radius or 0.0 for radius in radii)
    if high - low > SAME_RADIUS * high:
        what = f"the wheels' radii {low:g} and {high:g} m differ: pass --wheel-radius METRES"
        raise DescriptorError(what, path=path, line=left.line, key=left.name)
    return high
