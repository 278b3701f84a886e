"""Registers the ROS node of tool space. Imports no ROS."""

from __future__ import annotations

from robotd.api import NodeRegistry, hookimpl


@hookimpl
def robotd_register_nodes(registry: NodeRegistry) -> None:
    """Add ``servo_node``."""
    registry.add(
        "servo_node",
        "robotd_tool_space.servo_node:ServoNode",
        summary="motion of the tool on topics: twists and poses, as MoveIt Servo takes them",
        parameters="robotd_tool_space.servo_settings:read_servo",
    )
