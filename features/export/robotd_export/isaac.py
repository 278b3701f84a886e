"""Isaac Sim: nodes of its ROS 2 bridge and the robot's topics."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from robotd.api.models import DriveSettings
from robotd_export.export_input import ExportInput

STATE = "manipulator_state"
BASE = "diff_drive_controller"
TWO_SIDED = ("differential", "skid_steer")  # kinds of bases that this node moves
PARAMETER = "isaacsim_joint_topic"
SEPARATION = "wheel_separation_m"
MULTIPLIERS = (
    "wheel_separation_multiplier",
    "left_wheel_radius_multiplier",
    "right_wheel_radius_multiplier",
)


def topic_map(source: ExportInput) -> str:
    """Return a YAML list of OmniGraph nodes with topic, message type and content.

    Raises DescriptorError for a robot that publishes nothing for Isaac Sim.
    """
    drive = _two_sided(source)
    entries = []
    if STATE in source.descriptor.nodes and (topic := source.topic(STATE, PARAMETER)):
        entries.append(_joints(source, topic))
    if drive is not None:
        entries.append(_base(source, drive))
    if not entries:
        raise source.rejection(_nothing(source))
    entries.append(
        {
            "node": "ROS2 Publish Clock",
            "topic": "/clock",
            "type": "rosgraph_msgs/msg/Clock",
            "needed": "only when the robot runs with use_sim_time:=true",
        }
    )
    remarks = ["Nodes of the action graph in Isaac Sim. Units: rad, m, rad/s, m/s."]
    if drive is not None:
        remarks += _calibration(source, drive)
    return source.document(remarks, {"action_graph": entries})


def _joints(source: ExportInput, topic: str) -> dict[str, Any]:
    descriptor, gripper = source.descriptor, source.descriptor.gripper
    return {
        "node": "ROS2 Subscribe Joint State",
        "topic": topic,
        "type": "sensor_msgs/msg/JointState",
        "rate_hz": source.parameter(STATE, "joint_feedback_rate", int(descriptor.cycle.rate_hz)),
        "feeds": "Articulation Controller",
        "joints": [*descriptor.joint_names, *(gripper.joints if gripper else ())],
    }


def _two_sided(source: ExportInput) -> DriveSettings | None:
    """Return the drive where ``BASE`` moves it, else None."""
    drive = source.descriptor.drive
    is_moved = drive is not None and drive.kind in TWO_SIDED and BASE in source.descriptor.nodes
    return drive if is_moved else None


def _base(source: ExportInput, drive: DriveSettings) -> dict[str, Any]:
    return {
        "node": "ROS2 Subscribe Twist",
        "topic": source.needed_topic(BASE, "encoder_vel_topic"),
        "type": "geometry_msgs/msg/Twist",
        "feeds": "Differential Controller",
        "wheel_radius_m": float(source.parameter(BASE, "wheel_radius", drive.wheel_radius_m)),
        "wheel_distance_m": float(
            source.parameter(BASE, "wheel_to_wheel", getattr(drive, SEPARATION))
        ),
    }


def _calibration(source: ExportInput, drive: DriveSettings) -> Iterator[str]:
    """Explain the multipliers that calibrate the real wheels, where there are any."""
    factors = {name: source.parameter(BASE, name, getattr(drive, name)) for name in MULTIPLIERS}
    if any(factor != 1.0 for factor in factors.values()):
        named = ", ".join(f"{name} {factor:g}" for name, factor in factors.items())
        yield f"The wheels of the twin have their nominal size: {named} calibrate the real ones."


def _nothing(source: ExportInput) -> str:
    """Explain why there is no map, and name the variants that have one."""
    descriptor = source.descriptor
    text = f"{descriptor.name} publishes nothing for Isaac Sim: {STATE}.{PARAMETER} is not given"
    variants = [
        name
        for name, change in descriptor.variants.items()
        if change.get("ros_parameters", {}).get(STATE, {}).get(PARAMETER)
    ]
    return f"{text}; try --variant {' or '.join(variants)}" if variants else text
