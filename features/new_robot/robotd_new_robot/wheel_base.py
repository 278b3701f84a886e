"""Base of a URDF on wheels on two sides: its kind, its wheels, their radius and distance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from robotd.api import DescriptorError, UrdfJoint, UrdfRobot, get_logger
from robotd_new_robot.open_question import OpenQuestion
from robotd_new_robot.wheels import BaseKind, Wheel, base_kind, disc_radius

DEFAULT_WHEEL_VELOCITY_RAD_S = 10.0
SAME_RADIUS = 0.01  # part by which the wheels may differ
MIN_SEPARATION_M = 1e-3
FOOTPRINT = "base_footprint"
_UNDRIVEN = {
    BaseKind.ACKERMANN: "an Ackermann base, steered by {steered}: no plugin drives one. With one"
    " drive for the steering and one for the axle that drives it is kind: tricycle with traction:"
    " fixed, described by hand as in robots/tricycle_base",
    BaseKind.STEERED: "a base with four-wheel steering or the like, steered by {steered}: no plugin"
    " drives one",
    BaseKind.OMNI: "a base on omnidirectional wheels ({wheels}), whose axes have different"
    " directions: no plugin drives one",
    BaseKind.TRICYCLE: "a tricycle, steered by {steered}, is described by hand, as in"
    " robots/tricycle_base",
}

log = get_logger("new-robot")


@dataclass(frozen=True)
class WheelBase:
    """Driven wheels, as many on the left as on the right.

    Attributes:
        kind: differential, skid_steer or mecanum.
        left, right: joints of the wheels of each side; of a mecanum base the front ones first.
        frame: link that moves as the base does.
        wheelbase_m: distance between the foremost and the hindmost wheels.
        velocity_rad_s: of a wheel.
        is_assumed: the URDF has no speed, and ``velocity_rad_s`` is the default.
    """

    kind: BaseKind
    left: tuple[UrdfJoint, ...]
    right: tuple[UrdfJoint, ...]
    frame: str
    radius_m: float
    separation_m: float
    wheelbase_m: float
    velocity_rad_s: float
    is_assumed: bool

    @property
    def joints(self) -> tuple[UrdfJoint, ...]:
        """All wheels, the left ones first."""
        return self.left + self.right


def find_base(
    urdf: UrdfRobot,
    wheels: Sequence[Wheel],
    kind: BaseKind | None,
    radius_m: float | None,
    path: Path,
) -> WheelBase | None:
    """Return the base on the wheels of a URDF; None without wheels.

    Raises DescriptorError: no plugin drives such a base, or the URDF does not show which it is.
    """
    if not wheels:
        if kind is not None:
            what = "no wheels were found for --base: name the driven ones by --wheels LEFT,RIGHT"
            raise DescriptorError(what, path=path)
        return None
    joints = _left_first(urdf, [wheel.joint for wheel in wheels])
    names = ",".join(joint.name for joint in joints)
    first, found = joints[0], base_kind(urdf, wheels)
    steered = ", ".join(wheel.steering.name for wheel in wheels if wheel.steering)
    problem = _UNDRIVEN.get(found, "").format(steered=steered, wheels=names)
    if problem:
        what = f"{problem}; --no-base makes each joint an axis of its own"
        raise DescriptorError(what, path=path, line=first.line, key=first.name)
    if found is BaseKind.FOUR_WHEELS and kind is None:
        what = (
            f"4 wheels ({names}): pass --base skid_steer or --base mecanum; of a base with two"
            " driven wheels name those, the left one first, by --wheels LEFT,RIGHT, then the"
            " others are passive; --no-base makes each an axis of its own"
        )
        raise OpenQuestion(
            what,
            path=path,
            line=first.line,
            key=first.name,
            question=f"The wheels {names} make a base of the kind",
            choices=(BaseKind.SKID_STEER, BaseKind.MECANUM),
            default=BaseKind.SKID_STEER,
            option="kind",
        )
    if found is BaseKind.OTHER:
        what = (
            f"{len(wheels)} wheels ({names}): name the driven ones, the left ones first, by"
            " --wheels LEFT,RIGHT, then the others are passive; --no-base makes each an axis of"
            " its own"
        )
        raise DescriptorError(what, path=path, line=first.line, key=first.name)
    return wheel_base(urdf, joints, kind or found, radius_m, path)


def _left_first(urdf: UrdfRobot, wheels: Sequence[UrdfJoint]) -> list[UrdfJoint]:
    """Return the left half of the wheels, then the right half, by y (REP 103)."""
    by_side = sorted(wheels, key=lambda joint: -_place(urdf, joint)[1])
    half = len(by_side) // 2
    return [
        *(joint for joint in wheels if joint in by_side[:half]),
        *(joint for joint in wheels if joint in by_side[half:]),
    ]


def wheel_base(
    urdf: UrdfRobot,
    wheels: Sequence[UrdfJoint],
    kind: BaseKind | None,
    radius_m: float | None,
    path: Path,
) -> WheelBase:
    """Return the base on ``wheels``, of which the first half is on the left.

    The order wins over the geometry: ``robotd check`` tells where they contradict each other.
    Without a ``kind`` several wheels a side make a skid-steer base.

    Raises DescriptorError: an odd number of wheels, or one that the kind does not have, a joint
    that does not turn, or sides that the geometry does not separate. An OpenQuestion without a
    radius.
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
    if kind is None:
        kind = BaseKind.DIFFERENTIAL if half == 1 else BaseKind.SKID_STEER
    counts = {BaseKind.DIFFERENTIAL: half == 1, BaseKind.MECANUM: half == 2}
    if not counts.get(kind, half > 1):
        what = f"{len(wheels)} wheels make no {kind} base: name its driven wheels by --wheels"
        raise DescriptorError(what, path=path, line=wheels[0].line, key=wheels[0].name)
    left, right = tuple(wheels[:half]), tuple(wheels[half:])
    if kind is BaseKind.MECANUM:
        left, right = (
            tuple(sorted(side, key=lambda joint: -_place(urdf, joint)[0])) for side in (left, right)
        )
    y_left, y_right = ([_place(urdf, joint)[1] for joint in side] for side in (left, right))
    gap = max(min(y_left) - max(y_right), min(y_right) - max(y_left))
    if gap < MIN_SEPARATION_M:
        named = ", ".join(
            f"{joint.name} at y {y:g}"
            for joint, y in zip(left + right, y_left + y_right, strict=True)
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
    along = [_place(urdf, joint)[0] for joint in wheels]
    return WheelBase(
        kind,
        left,
        right,
        FOOTPRINT if FOOTPRINT in urdf.links else left[0].parent,
        radius_m or _radius(urdf, wheels, path),
        abs(sum(y_left) - sum(y_right)) / half,
        max(along) - min(along),
        min(known, default=DEFAULT_WHEEL_VELOCITY_RAD_S),
        not known,
    )


def _place(urdf: UrdfRobot, joint: UrdfJoint) -> tuple[float, float]:
    """Return x and y of a wheel in the frame of the root, m."""
    x, y = urdf.pose(joint.child, {})[:2, 3]
    return float(x), float(y)


def _turns_backwards(urdf: UrdfRobot, joint: UrdfJoint) -> bool:
    return float((urdf.pose(joint.child, {})[:3, :3] @ joint.axis)[1]) < -0.5


def _radius(urdf: UrdfRobot, wheels: Sequence[UrdfJoint], path: Path) -> float:
    radii = [urdf.links[joint.child].radius for joint in wheels]
    for joint, radius in zip(wheels, radii, strict=True):
        if not radius:
            guess = disc_radius(urdf, joint)
            hint = f"; a disc of its inertia has {guess:.3g} m" if guess else ""
            what = (
                f"link {joint.child!r} has no cylinder or sphere that gives the wheel's radius:"
                f" pass --wheel-radius METRES{hint}"
            )
            raise OpenQuestion(
                what,
                path=path,
                line=joint.line,
                key=joint.name,
                question="Radius of the wheels, m",
                default=float(f"{guess:.3g}") if guess else None,
                option="wheel_radius_m",
            )
    known = [radius or 0.0 for radius in radii]
    low, high = min(known), max(known)
    if high - low > SAME_RADIUS * high:
        what = f"the wheels' radii {low:g} and {high:g} m differ: pass --wheel-radius METRES"
        raise DescriptorError(what, path=path, line=wheels[0].line, key=wheels[0].name)
    return high
