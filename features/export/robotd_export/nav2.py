"""Nav2 (Jazzy): topics, frames and limits of a mobile base."""

from __future__ import annotations

from typing import Any, NamedTuple

from robotd.api.models import DriveSettings
from robotd_export.export_input import ExportInput

DIFFERENTIAL = "diff_drive_controller"
MECANUM = "mecanum_drive_controller"
TRICYCLE = "tricycle_controller"
MAP = "map"
COMMANDING = ("controller_server", "behavior_server", "velocity_smoother", "collision_monitor",
              "docking_server")  # fmt: skip


class _Base(NamedTuple):
    """A base as Nav2 needs it.

    Attributes:
        node: its ROS node.
        command, odometry: resolved topics.
        stamped: commands are ``TwistStamped``.
        motion_model: of AMCL.
        transform: advice where the transform of the odometry is not on ``tf``; "" if it is.
    """

    node: str
    command: str
    odometry: str
    stamped: bool
    motion_model: str
    transform: str


def navigation_parameters(source: ExportInput) -> str:
    """Return a ROS parameter file with the base's topics, frames and limits for Nav2.

    Raises DescriptorError for a robot without a drive or without its node.
    """
    drive = source.descriptor.drive
    if drive is None:
        raise source.rejection(f"nav2: {source.descriptor.name} has no drive")
    of_kind = {"mecanum": _mecanum, "tricycle": _tricycle}
    base = of_kind.get(drive.kind, _differential)(source)
    nodes = _nodes(source, base)
    for name in COMMANDING:
        nodes.setdefault(name, {})["enable_stamped_cmd_vel"] = base.stamped
    content = {name: {"ros__parameters": values} for name, values in nodes.items()}
    for name in ("local_costmap", "global_costmap"):
        content[name] = {name: content[name]}
    return source.document(_remarks(base), content)


def _differential(source: ExportInput) -> _Base:
    advice = "Nav2 needs the transform of the odometry: run the robot with publish_tf."
    return _Base(
        DIFFERENTIAL,
        source.needed_topic(DIFFERENTIAL, "cmd_vel_topic"),
        source.needed_topic(DIFFERENTIAL, "encoder_odometry_topic"),
        bool(source.parameter(DIFFERENTIAL, "use_stamped_vel", False)),
        "nav2_amcl::DifferentialMotionModel",
        "" if source.parameter(DIFFERENTIAL, "publish_tf", False) else advice,
    )


def _mecanum(source: ExportInput) -> _Base:
    stamped = bool(source.parameter(MECANUM, "use_stamped_vel", True))
    topic = source.own_topic(MECANUM, "tf_odometry")
    advice = f"Nav2 needs the transform of the odometry: run the robot with -r {topic}:=/tf."
    if not source.parameter(MECANUM, "enable_odom_tf", True):
        advice = "Nav2 needs the transform of the odometry: enable_odom_tf of the base is false."
    return _Base(
        MECANUM,
        source.own_topic(MECANUM, "reference" if stamped else "reference_unstamped"),
        source.own_topic(MECANUM, "odometry"),
        stamped,
        "nav2_amcl::OmniMotionModel",
        advice,
    )


def _tricycle(source: ExportInput) -> _Base:
    advice = "Nav2 needs the transform of the odometry: enable_odom_tf of the base is false."
    return _Base(
        TRICYCLE,
        source.own_topic(TRICYCLE, "cmd_vel"),
        source.own_topic(TRICYCLE, "odom"),
        bool(source.parameter(TRICYCLE, "use_stamped_vel", True)),
        "nav2_amcl::DifferentialMotionModel",  # AMCL has no other one without sideways motion
        "" if source.parameter(TRICYCLE, "enable_odom_tf", True) else advice,
    )


def _nodes(source: ExportInput, base: _Base) -> dict[str, dict[str, Any]]:
    odom = str(source.parameter(base.node, "odom_frame_id", "odom"))
    frame = str(source.parameter(base.node, "base_frame_id", "base_link"))
    limits = twist_limits(source)
    return {
        "amcl": {
            "robot_model_type": base.motion_model,
            "odom_frame_id": odom,
            "base_frame_id": frame,
        },
        "bt_navigator": {
            "global_frame": MAP,
            "robot_base_frame": frame,
            "odom_topic": base.odometry,
        },
        "controller_server": {"odom_topic": base.odometry},
        "local_costmap": {"global_frame": odom, "robot_base_frame": frame},
        "global_costmap": {"global_frame": MAP, "robot_base_frame": frame},
        "behavior_server": {
            "local_frame": odom,
            "global_frame": MAP,
            "robot_base_frame": frame,
            "max_rotational_vel": limits["max_velocity"][2],
            "rotational_acc_lim": limits["max_accel"][2],
        },
        "velocity_smoother": {"odom_topic": base.odometry, **limits},
        "collision_monitor": {
            "base_frame_id": frame,
            "odom_frame_id": odom,
            "cmd_vel_out_topic": base.command,
        },
        "docking_server": {"base_frame": frame, "fixed_frame": odom},
    }


def twist_limits(source: ExportInput) -> dict[str, list[float]]:
    """Return the limits of [x, y, yaw] in m/s, rad/s, m/s², rad/s²; decelerations negative.

    As in the node of a differential base, ``acc_time`` and ``dec_time`` may lower its ramps.
    """
    drive = source.descriptor.drive
    if drive is None:
        raise source.rejection(f"{source.descriptor.name} has no drive")
    node = {"mecanum": MECANUM, "tricycle": TRICYCLE}.get(drive.kind, DIFFERENTIAL)

    def of_node(name: str, default: float) -> float:
        return float(source.parameter(node, name, default))

    def limits(kind: str) -> list[float]:
        values = zip(("linear.x", "linear.y", "angular.z"), _limits(drive, kind), strict=True)
        return [of_node(f"{part}.max_{kind}", value) if value else 0.0 for part, value in values]

    speeds = limits("velocity")

    def ramp(kind: str, time: str) -> list[float]:
        if node != DIFFERENTIAL:
            return limits(kind)
        time_s = of_node(time, 1.0)
        return [min(a, v / time_s) for a, v in zip(limits(kind), speeds, strict=True)]

    return {
        "max_velocity": speeds,
        "min_velocity": [-speed if speed else 0.0 for speed in speeds],
        "max_accel": ramp("acceleration", "acc_time"),
        "max_decel": [-value if value else 0.0 for value in ramp("deceleration", "dec_time")],
    }


def _limits(drive: DriveSettings, kind: str) -> tuple[float, float, float]:
    """Return the descriptor's limits of x, y and yaw; y is 0 without sideways motion."""
    unit = "m_s" if kind == "velocity" else "m_s2"
    return (
        getattr(drive, f"{kind}_{unit}"),
        getattr(drive, f"lateral_{kind}_{unit}", 0.0),
        getattr(drive, f"angular_{kind}_{unit.replace('m', 'rad')}"),
    )


def _remarks(base: _Base) -> list[str]:
    kind = "TwistStamped" if base.stamped else "Twist"
    lines = [
        "Merge it into your parameters of Nav2 (Jazzy). Footprint, sensors and planners are yours.",
        f"Nav2 commands the base on {base.command} (geometry_msgs/msg/{kind}).",
    ]
    return [*lines, base.transform] if base.transform else lines
