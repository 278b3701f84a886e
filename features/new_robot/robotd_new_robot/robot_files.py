"""Text of a new robot's ``robot.yaml``: every value with its reason."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import yaml

from robotd.api import get_logger
from robotd.api.models import NAME, UrdfJoint, UrdfRobot
from robotd_new_robot.answers import with_assumed_speeds
from robotd_new_robot.bus_axes import bus_joints, bus_section, read_bus_scan
from robotd_new_robot.drive_models import COULOMB_SHARE, VISCOUS_SHARE, per_axis
from robotd_new_robot.joint_roles import FingerJoints, Roles
from robotd_new_robot.robot_plan import RobotPlan
from robotd_new_robot.wheel_base import WheelBase
from robotd_new_robot.wheels import BaseKind

log = get_logger("new-robot")

MAX_BASE_VELOCITY_M_S = 1.0  # moderate, for a machine that was never driven
MAX_BASE_TURNING_RAD_S = 2.0
BASE_RAMP_S = 0.5
LATERAL_SHARE = 0.8  # of the speed ahead
SQUEEZE_SHARE = 0.05  # of the stroke
_MECANUM_AXES = ("front_left", "front_right", "rear_left", "rear_right")
ASSUMED = "Speeds assumed (0.5 rad/s, 0.05 m/s)"
WIDTH = 96  # of comments
LONGEST = 10_000  # line of a text
SERVICE_NODES = ("wmx_engine_node", "wmx_core_motion_node", "wmx_io_node", "wmx_ethercat_node")

_URDF_LIMITS = (
    "Order and limits are those of the URDF, of hard and soft limits the tighter; axes are numbered"
    " in this order: replace them by the numbers of the drives. A URDF has no accelerations: full"
    " speed is reached in {ramp_s:g} s. rated_torque_nm (rated_force_n), the drive's 100 %, is in"
    " no URDF."
)
_BUS_LIMITS = (
    "A bus has neither names nor limits: joints are called as their drives and turn half a turn"
    " to each side, slowly, reaching full speed in {ramp_s:g} s. Replace names and limits by those"
    " of the machine; a linear axis has type: prismatic and the keys lower_m, upper_m,"
    " velocity_m_s, acceleration_m_s2. 'robotd commission' finds scale, direction and limits of"
    " drives whose backend keeps them in this file."
)
_UNITS = {"prismatic": ("m", "m_s", "m_s2")}
_TURNING = ("rad", "rad_s", "rad_s2")


def robot_files(name: str, plan: RobotPlan, bus: Path | None = None) -> dict[str, bytes]:
    """Return the files of a robot's folder: ``robot.yaml`` and the URDF.

    Args:
        bus: result of a bus scan, see ``BusScan``.

    Raises DescriptorError: a scan that does not fit.
    """
    urdf, roles, ramp_s = plan.urdf, plan.roles, plan.choices.ramp_s
    if plan.assumed:
        text = "speeds assumed: pass --speed JOINT=SPEED for the real ones"
        log.warning(text, joints=plan.assumed)
    if plan.renamed:
        log.warning("joints renamed: see robot.yaml", joints=plan.renamed)
    arm = with_assumed_speeds(roles.arm)
    joints = [*arm, *(roles.base.joints if roles.base else ())]
    return {
        "robot.yaml": _text(
            [*_head(name, urdf.name or name, plan.path), f"urdf: {name}.urdf"],
            _renamed(plan.renamed),
            _joints(arm, ramp_s, _URDF_LIMITS, plan.assumed),
            _groups(plan),
            _base(roles),
            _gripper(urdf, roles.fingers),
            _servo_grippers(plan),
            _passive(roles),
            _nodes(roles),
            _ros_parameters(name, roles, plan.groups),
            _backends(per_axis(urdf, joints), joints, bus),
        ),
        f"{name}.urdf": plan.text.encode(),
    }


def bus_robot_files(name: str, bus: Path, ramp_s: float) -> dict[str, bytes]:
    """Return the files of a robot that is known by its drives alone: ``robot.yaml``.

    Args:
        bus: result of a bus scan, see ``BusScan``.
        ramp_s: time to full speed.

    Raises DescriptorError: no scan, no drive, or too many.
    """
    joints = bus_joints(read_bus_scan(bus), bus)
    roles = Roles(joints, None, None, ())
    return {
        "robot.yaml": _text(
            _head(name, name, bus),
            _joints(joints, ramp_s, _BUS_LIMITS),
            _nodes(roles),
            _ros_parameters(name, roles, {}),
            _backends({}, joints, bus),
        )
    }


def _text(*parts: Iterable[str]) -> bytes:
    """Return the parts that are not empty, with a blank line between them.

    Texts of other files, such as names in comments, begin no line of their own.
    """
    lines = ([*map(_printable, part)] for part in parts)
    return "\n".join("\n".join(part) + "\n" for part in filter(None, lines)).encode()


def _printable(line: str) -> str:
    return "".join(
        character if character.isprintable() else "\N{REPLACEMENT CHARACTER}" for character in line
    )


def _head(name: str, title: str, path: Path) -> Iterator[str]:
    yield f"# Made by 'robotd new-robot {name}' from {path.name}; edit it from here on."
    yield "# Keys: robotd docs reference/descriptor. Check changes by: robotd check --robot FILE"
    yield "schema: 1"
    yield f"name: {name}"
    yield f"summary: {_quoted(f'{title}, from {path.name}')}"
    yield "backend: sim                            # replaced by --backend on the command line"


def _renamed(renamed: Mapping[str, str]) -> Iterator[str]:
    if renamed:
        yield from _comment(
            "Names of joints that neither ROS parameters nor this file allow are replaced, here and"
            " in the URDF beside it; links, the frames, keep theirs. Clients use the new names:"
        )
    for old, new in renamed.items():
        yield f"#   {new}: {old}"


def _joints(
    joints: Sequence[UrdfJoint], ramp_s: float, origin: str, assumed: Sequence[str] = ()
) -> Iterator[str]:
    if not joints:
        return
    yield from _comment(origin.format(ramp_s=ramp_s))
    if assumed:
        yield from _comment(
            f"{ASSUMED} for {', '.join(assumed)}: the URDF has none, or a placeholder."
        )
    yield "joints:"
    for axis, joint in enumerate(joints):
        yield f"  - {{{', '.join(_joint(joint, axis, ramp_s))}}}"


def _joint(joint: UrdfJoint, axis: int, ramp_s: float) -> Iterator[str]:
    position, velocity, acceleration = _UNITS.get(joint.type, _TURNING)
    speed = joint.velocity or 0.0
    yield f"name: {_word(joint.name)}"
    yield f"axis: {axis}"
    if joint.type != "revolute":
        yield f"type: {joint.type}"
    if joint.type != "continuous":
        yield f"lower_{position}: {_number(joint.lower)}"
        yield f"upper_{position}: {_number(joint.upper)}"
    yield f"velocity_{velocity}: {_number(speed)}"
    yield f"acceleration_{acceleration}: {_rounded(speed / ramp_s)}"


def _groups(plan: RobotPlan) -> Iterator[str]:
    if not plan.groups:
        for link in plan.tools.values():  # of the only arm
            yield f"tool_link: {_word(link)}      # by its name: the frame of the tool"
        return
    srdf = plan.srdf
    origin = f"Groups of {srdf.name}, and branches of" if srdf else "The branches of"
    yield from _comment(
        f"{origin} the tree; fingers are groups of their own. Each group has goals and streams of"
        " its own, at the same time as the others; without groups, or with --no-groups, all joints"
        " are one. tool_link: the frame of the tool, by its name; without one it is the link that"
        " the last joint moves."
    )
    yield "groups:"
    for name, joints in plan.groups.items():
        tool = f", tool_link: {_word(plan.tools[name])}" if name in plan.tools else ""
        yield f"  {_word(name)}: {{joints: [{_words(joints)}]{tool}}}"


def _base(roles: Roles) -> Iterator[str]:
    base = roles.base
    if base is None:
        return
    first = len(roles.arm)
    fastest = base.velocity_rad_s * base.radius_m
    speed = min(fastest, MAX_BASE_VELOCITY_M_S)
    turning = min(2.0 * fastest / base.separation_m, MAX_BASE_TURNING_RAD_S)
    left, right = (" and ".join(joint.name for joint in side) for side in (base.left, base.right))
    origin = "assumed: the URDF has none" if base.is_assumed else "the URDF's"
    yield from _comment(
        f"Wheels {left} on the left, {right} on the right. Speeds and ramps of the base are"
        " moderate ones, to be replaced by those of the machine; the wheels' speed limits both"
        " parts of a twist. The base moves independently of the joints and is not a group."
    )
    yield "drive:"
    per_side = len(base.left)
    yield f"  kind: {base.kind}"
    wheels = base.joints
    if base.kind is BaseKind.DIFFERENTIAL:
        yield f"  left_axis: {first}"
        yield f"  right_axis: {first + 1}"
    elif base.kind is BaseKind.SKID_STEER:
        yield f"  left_axes: [{_range(first, per_side)}]"
        yield f"  right_axes: [{_range(first + per_side, per_side)}]"
    else:
        wheels = tuple(joint for end in zip(base.left, base.right, strict=True) for joint in end)
        for place, axis in zip(_MECANUM_AXES, (0, 2, 1, 3), strict=True):
            yield f"  {place}_axis: {first + axis}"
        yield f"  wheelbase_m: {_rounded(base.wheelbase_m)}"
    yield f"  wheel_joints: [{_words(wheels)}]"
    yield f"  wheel_radius_m: {_rounded(base.radius_m)}"
    yield f"  wheel_separation_m: {_rounded(base.separation_m)}"
    if base.kind is BaseKind.SKID_STEER:
        yield "  # The wheels slip in turns: calibrate wheel_separation_multiplier, often 1.2 to 2."
    yield f"  wheel_velocity_rad_s: {_number(base.velocity_rad_s)}      # {origin}"
    yield f"  velocity_m_s: {_rounded(speed)}"
    yield f"  acceleration_m_s2: {_rounded(speed / BASE_RAMP_S)}"
    yield f"  deceleration_m_s2: {_rounded(speed / BASE_RAMP_S)}"
    if base.kind is BaseKind.MECANUM:  # rollers slip more sideways
        yield f"  lateral_velocity_m_s: {_rounded(LATERAL_SHARE * speed)}"
        yield f"  lateral_acceleration_m_s2: {_rounded(LATERAL_SHARE * speed / BASE_RAMP_S)}"
        yield f"  lateral_deceleration_m_s2: {_rounded(LATERAL_SHARE * speed / BASE_RAMP_S)}"
    yield f"  angular_velocity_rad_s: {_rounded(turning)}"
    yield f"  angular_acceleration_rad_s2: {_rounded(turning / BASE_RAMP_S)}"
    yield f"  angular_deceleration_rad_s2: {_rounded(turning / BASE_RAMP_S)}"


def _gripper(urdf: UrdfRobot, fingers: FingerJoints | None) -> Iterator[str]:
    if fingers is None:
        return
    opened, closed, is_known = _ends(urdf, fingers)
    yield from _comment(
        "Fingers on the valve of output bit 0.0: set the bit of the machine. A servo gripper is a"
        " joint instead: make the robot again with --gripper axis."
    )
    if not is_known:
        yield "# The URDF does not show which end is open: exchange open_m and closed_m if need be."
    yield "gripper:"
    yield "  output_byte: 0"
    yield "  output_bit: 0"
    yield f"  joints: [{_words(fingers.joints)}]"
    if any(share != 1.0 for share in fingers.multipliers):
        yield f"  multipliers: [{', '.join(_number(share) for share in fingers.multipliers)}]"
    yield f"  open_m: {_number(opened)}"
    yield f"  closed_m: {_number(closed)}"
    if fingers.leader.velocity:
        travel_s = abs(closed - opened) / fingers.leader.velocity
        yield f"  travel_time_s: {_rounded(travel_s)}      # the stroke at the URDF's speed"


def _servo_grippers(plan: RobotPlan) -> Iterator[str]:
    """Yield the section of grippers that a servo moves, as a comment."""
    grippers = {name: held[0] for name, held in plan.hands.items() if len(held) == 1}
    ranged = {name: joint for name, joint in grippers.items() if joint.type != "continuous"}
    if not ranged:
        return
    yield from _comment(
        "A URDF shows neither which end of a servo gripper is open nor how hard it may press."
        " Remove the # when both are right, for 'robotd gripper' and the node gripper_controller:"
    )
    yield "# servo_grippers:"
    for name, joint in ranged.items():
        stroke = joint.upper - joint.lower
        keys = (
            f"joint: {_word(joint.name)}",
            f"open_position: {_number(joint.upper)}",
            f"closed_position: {_number(joint.lower)}",
            f"squeeze: {_rounded(SQUEEZE_SHARE * stroke)}",
        )
        yield f"#   {_word(name)}: {{{', '.join(keys)}}}"


def _ends(urdf: UrdfRobot, fingers: FingerJoints) -> tuple[float, float, bool]:
    """Return the open and the closed position, and if the URDF shows them."""
    leader = fingers.leader
    lower, upper = max(leader.lower, -np.pi), min(leader.upper, np.pi)
    spread = []
    for position in (lower, upper):
        positions = {
            joint.name: share * position
            for joint, share in zip(fingers.joints, fingers.multipliers, strict=True)
        }
        points = [urdf.pose(joint.child, positions)[:3, 3] for joint in fingers.joints]
        spread.append(sum(float(np.linalg.norm(point - points[0])) for point in points))
    if abs(spread[0] - spread[1]) < 1e-6:
        return lower, upper, False
    return (lower, upper, True) if spread[0] > spread[1] else (upper, lower, True)


def _passive(roles: Roles) -> Iterator[str]:
    if roles.passive:
        yield "# Joints of the URDF that have no axis:"
        for joint, reason in roles.passive:
            yield f"#   {joint.name}: {reason}"


def _nodes(roles: Roles) -> Iterator[str]:
    yield "nodes:"
    arm = ("manipulator_state", "follow_joint_trajectory_server") if roles.arm else ()
    base = (_base_node(roles.base),) if roles.base else ()
    for node in (*SERVICE_NODES, *arm, *base):
        yield f"  - {node}"


def _base_node(base: WheelBase) -> str:
    is_mecanum = base.kind is BaseKind.MECANUM
    return "mecanum_drive_controller" if is_mecanum else "diff_drive_controller"


def _ros_parameters(
    name: str, roles: Roles, groups: Mapping[str, Sequence[UrdfJoint]]
) -> Iterator[str]:
    yield "# Names that clients use; all others have defaults: robotd docs reference/ros-surface."
    yield "ros_parameters:"
    if roles.arm:
        yield "  manipulator_state:"
        yield "    encoder_joint_topic: joint_states"
        yield "  follow_joint_trajectory_server:"
        if not groups:
            yield f"    joint_trajectory_action: {name}_arm_controller/follow_joint_trajectory"
        for group in groups:
            action = f"{group}_controller/follow_joint_trajectory"
            yield f"    {group}.joint_trajectory_action: {action}"
        if roles.fingers:
            yield "    wmx_gripper_topic: wmx/set_gripper"
    if roles.base:
        yield f"  {_base_node(roles.base)}:"
        yield "    rate: 50"
        yield f"    base_frame_id: {_word(roles.base.frame)}"
        if roles.base.kind is BaseKind.MECANUM:
            return
        yield "    cmd_vel_topic: cmd_vel"
        yield "    encoder_vel_topic: cmd_vel_check"
        yield "    encoder_omega_topic: velocity_controller/commands"
        yield "    encoder_odometry_topic: odom"
        yield "    publish_tf: true                    # odom to base, as Nav2 needs it"


def _backends(
    lists: Mapping[str, Sequence[float]], joints: Sequence[UrdfJoint], bus: Path | None
) -> Iterator[str]:
    yield "backends:"
    yield "  sim:                                  # a figure per axis; kg and N if prismatic"
    reasons: Mapping[str, str] = {
        "inertia_kg_m2": "# From the masses beyond each joint, at position 0.",
        "coulomb_friction_nm": f"# Assumed: {COULOMB_SHARE:.0%} of the URDF's effort, at full"
        f" speed {VISCOUS_SHARE:.0%} more; without an effort the simulation's defaults.",
    }
    for key, values in lists.items():
        if key in reasons:
            yield f"    {reasons[key]}"
        yield f"    {key}: [{', '.join(map(_number, values))}]"
    if not lists:
        yield "    bandwidth_hz: 50.0                  # the default; no masses are known"
    if bus is not None:
        yield from bus_section(read_bus_scan(bus), joints, bus)


def _comment(text: str) -> Iterator[str]:
    return (f"# {line}" for line in textwrap.wrap(text, WIDTH))


def _range(first: int, count: int) -> str:
    return ", ".join(map(str, range(first, first + count)))


def _word(name: str) -> str:
    """Return a name as YAML, quoted where YAML reads another value (``null``, ``yes``)."""
    return name if NAME.fullmatch(name) and yaml.safe_load(name) == name else _quoted(name)


def _words(joints: Sequence[UrdfJoint]) -> str:
    return ", ".join(_word(joint.name) for joint in joints)


def _quoted(text: str) -> str:
    is_plain = text.isprintable()
    quoted: str = yaml.safe_dump(text, default_style='"', allow_unicode=is_plain, width=LONGEST)
    return quoted.removesuffix("\n")


def _number(value: float) -> str:
    """Format without loss."""
    return repr(float(value))


def _rounded(value: float) -> str:
    """Format to four digits."""
    return repr(float(f"{value:.4g}"))
