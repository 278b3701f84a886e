"""Base of a URDF on wheels on two sides: its wheels, their radius and distance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from robotd.api import DescriptorError, UrdfJoint, UrdfRobot, get_logger

DEFAULT_WHEEL_VELOCITY_RAD_S = 10.0
SAME_RADIUS = 0.01  # part by which the wheels may differ
MIN_SEPARATION_M = 1e-3
FOOTPRINT = "base_footprint"

log = get_logger("new-robot")


@dataclass(frozen=True)
class WheelBase:
    """Driven wheels, as many on the left as on the right.

    Attributes:
        left, right: joints of the wheels of each side.
        frame: link that moves as the base does.
        velocity_rad_s: of a wheel.
        is_assumed: the URDF has no speed, and ``velocity_rad_s`` is the default.
    """

    left: tuple[UrdfJoint, ...]
    right: tuple[UrdfJoint, ...]
    frame: str
    radius_m: float
    separation_m: float
    velocity_rad_s: float
    is_assumed: bool

    @property
    def joints(self) -> tuple[UrdfJoint, ...]:
        """All wheels, the left ones first."""
        return self.left + self.right


def left_first(urdf: UrdfRobot, wheels: Sequence[UrdfJoint]) -> list[UrdfJoint]:
    """Return the left half of the wheels, then the right half, by y (REP 103)."""
    by_side = sorted(wheels, key=lambda joint: -_side(urdf, joint))
    half = len(by_side) // 2
    return [
        *(joint for joint in wheels if joint in by_side[:half]),
        *(joint for joint in wheels if joint in by_side[half:]),
    ]


def wheel_base(
    urdf: UrdfRobot, wheels: Sequence[UrdfJoint], radius_m: float | None, path: Path
) -> WheelBase:
    """Return the base on ``wheels``, of which the first half is on the left.

    The order wins over the geometry: ``robotd check`` tells where they contradict each other.

    Raises DescriptorError: an odd number of wheels, a joint that does not turn, sides that the
    geometry does not separate, or no radius.
    """
    half = len(wheels) // 2
    if not half or len(wheels) % 2 or len({joint.name for joint in wheels}) < len(wheels):
        what = (
            "a base has as many left as right wheels: --wheels LEFT,RIGHT, the left ones first;"
            " --no-base makes each wheel an axis"
        )
        raise DescriptorError(what, path=path)
    for joint in wheels:
        if joint.type not in ("continuous", "revolute"):
            what = f"is {joint.type}: the joint of a wheel is continuous"
            raise DescriptorError(what, path=path, line=joint.line, key=joint.name)
    left, right = tuple(wheels[:half]), tuple(wheels[half:])
    y_left, y_right = ([_side(urdf, joint) for joint in side] for side in (left, right))
    gap = max(min(y_left) - max(y_right), min(y_right) - max(y_left))
    if gap < MIN_SEPARATION_M:
        named = ", ".join(
            f"{joint.name} at y {y:g}" for joint, y in zip(wheels, y_left + y_right, strict=True)
        )
        what = (
            f"the wheels are not on two sides ({named} m): name the left ones first, then the"
            " right ones; y of the base must point to the left; --no-base makes each wheel an axis"
        )
        raise DescriptorError(what, path=path, line=left[0].line, key=left[0].name)
    backwards = [joint.name for joint in wheels if _turns_backwards(urdf, joint)]
    if backwards:
        text = "wheels turn backwards in RViz and MuJoCo: let their axes point to the left"
        log.warning(text, joints=backwards)
    known = [joint.velocity for joint in wheels if joint.velocity is not None]
    return WheelBase(
        left,
        right,
        FOOTPRINT if FOOTPRINT in urdf.links else left[0].parent,
        radius_m or _radius(urdf, wheels, path),
        abs(sum(y_left) - sum(y_right)) / half,
        min(known, default=DEFAULT_WHEEL_VELOCITY_RAD_S),
        not known,
    )


def _side(urdf: UrdfRobot, joint: UrdfJoint) -> float:
    """Return y of a wheel in the frame of the root."""
    return float(urdf.pose(joint.child, {})[1, 3])


def _turns_backwards(urdf: UrdfRobot, joint: UrdfJoint) -> bool:
    return float((urdf.pose(joint.child, {})[:3, :3] @ joint.axis)[1]) < -0.5


def _radius(urdf: UrdfRobot, wheels: Sequence[UrdfJoint], path: Path) -> float:
    radii = [urdf.links[joint.child].radius for joint in wheels]
    for joint, radius in zip(wheels, radii, strict=True):
        if not radius:
            what = (
                f"link {joint.child!r} has no cylinder or sphere that gives the wheel's radius:"
                " pass --wheel-radius METRES"
            )
            raise DescriptorError(what, path=path, line=joint.line, key=joint.name)
    known = [radius or 0.0 for radius in radii]
    low, high = min(known), max(known)
    if high - low > SAME_RADIUS * high:
        what = f"the wheels' radii {low:g} and {high:g} m differ: pass --wheel-radius METRES"
        raise DescriptorError(what, path=path, line=wheels[0].line, key=wheels[0].name)
    return high
