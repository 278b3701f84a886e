"""What a page draws: robot, axes, limits, names and URDF, and the objects around it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from robotd.api import FloatArray
from robotd.api.features import MAX_IO_BYTES, Tap, identity
from robotd.api.models import RobotDescriptor
from robotd.api.robots import Gripper, PacedClock, Robot
from robotd_page.page_message import Message, json_text

PROTOCOL = 2  # of the messages; the page asks to be loaded again when it has another one
DIGITS = 5  # of poses: 0.01 mm


def describe(
    tap: Tap,
    nodes: Sequence[str],
    meshes: Mapping[str, str],
    *,
    has_control: bool = False,
    namespace: str = "/",
) -> dict[str, Any]:
    """Return the first message to a viewer.

    Args:
        nodes: names of the ROS nodes that are served.
        meshes: URL of each mesh, by its name in the URDF.
        has_control: the page can be unlocked to control the robot.
    """
    robot = tap.robot
    descriptor, clock = robot.descriptor, robot.clock
    return {
        "type": "description",
        "protocol": PROTOCOL,
        **identity(robot, namespace),
        "time_scale": _finite(clock.scale) if isinstance(clock, PacedClock) else 1.0,
        "rate_hz": descriptor.cycle.rate_hz,
        "wall_offset_s": tap.offset_ns * 1e-9,
        "axes": _axes(robot),
        "groups": [*robot.groups],
        "tools": [{"link": each.link, "base": each.base} for each in robot.tools],
        "fingers": _fingers(robot.gripper),
        "inputs": min(robot.io.sizes[0], MAX_IO_BYTES),
        "outputs": min(robot.io.sizes[1], MAX_IO_BYTES),
        "io_names": _io_names(descriptor),
        "nodes": [*nodes],
        "urdf": tap.urdf,
        "meshes": dict(meshes),
        "urdf_file": str(descriptor.urdf.absolute()) if descriptor.urdf else "",
        "has_control": has_control,
    }


def _axes(robot: Robot) -> list[dict[str, Any]]:
    joints = dict(zip(robot.joint_axes, robot.descriptor.joints, strict=True))
    drive = robot.descriptor.drive
    wheels = dict(zip(drive.axes, drive.wheel_joints, strict=False)) if drive else {}
    group_of = {name: group for group, each in robot.groups.items() for name in each.joint_names}
    described = []
    for axis, (name, limits) in enumerate(zip(robot.axes.names, robot.axes.limits, strict=True)):
        joint = joints.get(axis)
        kind = "joint" if joint else "wheel" if axis in robot.wheel_axes else "axis"
        described.append(
            {
                "name": name,
                "kind": kind,
                "joint": name if joint else wheels.get(axis, ""),
                "group": group_of.get(name, "") if len(robot.groups) > 1 else "",
                "unit": limits.unit,
                "lower": _finite(limits.lower),
                "upper": _finite(limits.upper),
                "velocity": _finite(limits.velocity),
                "effort": joint.rated_effort if joint else None,
            }
        )
    return described


def _fingers(gripper: Gripper | None) -> list[dict[str, Any]]:
    """Return name and positions of each finger joint."""
    if gripper is None:
        return []
    return [
        {"name": name, "open": opened, "closed": closed}
        for name, (opened, closed) in gripper.finger_ends.items()
    ]


def _io_names(descriptor: RobotDescriptor) -> dict[str, str]:
    """Return names by address: ``out0.3`` is bit 3 of output byte 0."""
    names: dict[str, str] = {}
    if gripper := descriptor.gripper:
        names[f"out{gripper.output_byte}.{gripper.output_bit}"] = "close gripper"
        if sensor := gripper.part_sensor:
            names[f"in{sensor.input_byte}.{sensor.input_bit}"] = "part in gripper"
    if stop := descriptor.stop_input:
        names[f"in{stop.input_byte}.{stop.input_bit}"] = "stop input"
    names |= {f"in{at.byte}.{at.bit}": name for name, at in descriptor.inputs.items()}
    names |= {f"out{at.byte}.{at.bit}": name for name, at in descriptor.outputs.items()}
    return names


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


class WorldObjects:
    """Shapes and poses of the objects of a robot's world, which may have none. One thread."""

    def __init__(self, robot: Robot) -> None:
        self._robot, self._world = robot, robot.world
        self._shown: FloatArray = np.empty(0)

    def describe(self) -> dict[str, Any] | None:
        """Return the frame, and shape and pose of each object; None without objects."""
        world = self._world
        if world is None or not world.objects:
            return None
        shapes = [
            {"name": each.name, "shape": each.shape, "size": each.size_m, "color": each.color}
            for each in world.objects
        ]
        return {"frame": world.frame, "shapes": shapes, "poses": self._poses().tolist()}

    def moved(self) -> Message | None:
        """Return the poses where they differ from those of the call before."""
        if self._world is None or not self._robot.connection.ready:
            return None
        poses = self._poses()
        if np.array_equal(poses, self._shown):
            return None
        self._shown = poses
        return json_text({"type": "objects", "poses": poses.tolist()})

    def _poses(self) -> FloatArray:
        """Return the rounded poses (n, 7), m and quaternions x, y, z, w."""
        return np.empty(0) if self._world is None else self._world.poses().round(DIGITS)
