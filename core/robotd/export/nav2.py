"""Nav2 (Jazzy): topics, frames and limits of a mobile base."""

from __future__ import annotations

from typing import Any

from robotd.export.export_input import ExportInput

NODE = "diff_drive_controller"
MAP = "map"
COMMANDING = ("controller_server", "behavior_server", "velocity_smoother", "collision_monitor",
              "docking_server")  # fmt: skip


def navigation_parameters(source: ExportInput) -> str:
    """Return a ROS parameter file with the base's topics, frames and limits for Nav2.

    Raises DescriptorError for a robot without a drive or without its node.
    """
    if source.descriptor.drive is None:
        raise source.rejection(f"nav2: {source.descriptor.name} has no drive")
    command = source.needed_topic(NODE, "cmd_vel_topic")
    nodes = _nodes(source, command)
    stamped = bool(source.parameter(NODE, "use_stamped_vel", False))
    for name in COMMANDING:
        nodes.setdefault(name, {})["enable_stamped_cmd_vel"] = stamped
    content = {name: {"ros__parameters": values} for name, values in nodes.items()}
    for name in ("local_costmap", "global_costmap"):
        content[name] = {name: content[name]}
    return source.document(_remarks(source, command, stamped=stamped), content)


def _nodes(source: ExportInput, command: str) -> dict[str, dict[str, Any]]:
    odom_topic = source.needed_topic(NODE, "encoder_odometry_topic")
    odom = str(source.parameter(NODE, "odom_frame_id", "odom"))
    base = str(source.parameter(NODE, "base_frame_id", "base_link"))
    limits = twist_limits(source)
    return {
        "bt_navigator": {
            "global_frame": MAP,
            "robot_base_frame": base,
            "odom_topic": odom_topic,
        },
        "controller_server": {"odom_topic": odom_topic},
        "local_costmap": {"global_frame": odom, "robot_base_frame": base},
        "global_costmap": {"global_frame": MAP, "robot_base_frame": base},
        "behavior_server": {
            "local_frame": odom,
            "global_frame": MAP,
            "robot_base_frame": base,
            "max_rotational_vel": limits["max_velocity"][2],
            "rotational_acc_lim": limits["max_accel"][2],
        },
        "velocity_smoother": {"odom_topic": odom_topic, **limits},
        "collision_monitor": {
            "base_frame_id": base,
            "odom_frame_id": odom,
            "cmd_vel_out_topic": command,
        },
        "docking_server": {"base_frame": base, "fixed_frame": odom},
    }


def twist_limits(source: ExportInput) -> dict[str, list[float]]:
    """Return the limits of [x, y, yaw] in m/s, rad/s, m/s², rad/s²; decelerations negative.

    As in the node, ``acc_time`` and ``dec_time`` may lower the ramps of the drive.
    """
    drive = source.descriptor.drive
    if drive is None:
        raise source.rejection(f"{source.descriptor.name} has no drive")

    def of_node(name: str, default: float) -> float:
        return float(source.parameter(NODE, name, default))

    def pair(kind: str, x: float, yaw: float) -> tuple[float, float]:
        return of_node(f"linear.x.max_{kind}", x), of_node(f"angular.z.max_{kind}", yaw)

    speeds = pair("velocity", drive.velocity_m_s, drive.angular_velocity_rad_s)

    def ramp(kind: str, time: str, x: float, yaw: float) -> tuple[float, ...]:
        time_s = of_node(time, 1.0)
        highest = pair(kind, x, yaw)
        return tuple(min(a, v / time_s) for a, v in zip(highest, speeds, strict=True))

    rise = ramp(
        "acceleration", "acc_time", drive.acceleration_m_s2, drive.angular_acceleration_rad_s2
    )
    fall = ramp(
        "deceleration", "dec_time", drive.deceleration_m_s2, drive.angular_deceleration_rad_s2
    )
    return {
        "max_velocity": [speeds[0], 0.0, speeds[1]],
        "min_velocity": [-speeds[0], 0.0, -speeds[1]],
        "max_accel": [rise[0], 0.0, rise[1]],
        "max_decel": [-fall[0], 0.0, -fall[1]],
    }


def _remarks(source: ExportInput, command: str, *, stamped: bool) -> list[str]:
    kind = "TwistStamped" if stamped else "Twist"
    lines = [
        "Merge it into your parameters of Nav2 (Jazzy). Footprint, sensors and planners are yours.",
        f"Nav2 commands the base on {command} (geometry_msgs/msg/{kind}).",
    ]
    if not source.parameter(NODE, "publish_tf", False):
        lines.append("Nav2 needs the transform of the odometry: run the robot with publish_tf.")
    return lines
