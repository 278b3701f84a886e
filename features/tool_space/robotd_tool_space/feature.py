"""Tool space as a feature: keys of the robot's file, guards, services, and nodes.

Imports no ROS.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from robotd.api import DescriptorError, Unsupported, get_logger, hookimpl
from robotd.api.features import Feature
from robotd_tool_space.settings import ToolSpaceKeys

if TYPE_CHECKING:  # every command that reads a robot's file imports this module
    from robotd.api import NodeRegistry
    from robotd.api.features import FeatureHost

log = get_logger("tool")

FEATURE = Feature(
    summary="motion of the tool: poses, straight lines, kinematics, tool and work frames",
    settings=ToolSpaceKeys,
    open="robotd_tool_space.feature:open_tool_space",
    nodes="robotd_tool_space.nodes.tool_nodes:add_tool_nodes",
    guards={
        "tool_space.reduced_speed_input": "robotd_tool_space.link_speeds:reduced_speed",
        "tool_space.collisions": "robotd_tool_space.collision_guard:CollisionGuard",
    },
)


@contextmanager
def open_tool_space(host: FeatureHost) -> Iterator[object | None]:
    """Return the tools of a robot; None where it has none."""
    groups = None
    if host.robot.tools:
        from robotd_tool_space.tool_groups import ToolGroups

        try:
            groups = host.robot.feature(ToolGroups)
        except (DescriptorError, Unsupported) as error:
            log.warning("no motion of the tool", reason=str(error))
    yield groups


@hookimpl
def robotd_register_nodes(registry: NodeRegistry) -> None:
    """Add the nodes that a robot lists to have them."""
    registry.add(
        "servo_node",
        "robotd_tool_space.nodes.servo_node:ServoNode",
        summary="motion of the tool on topics: twists and poses, as MoveIt Servo takes them",
        parameters="robotd_tool_space.nodes.node_settings:read_servo",
    )
    registry.add(
        "wmx_robot_option_node",
        "robotd_tool_space.nodes.r2_node:WmxRobotOptionNode",
        summary="motion of the whole robot by services, as WMX R2 has it",
        parameters="robotd_tool_space.nodes.node_settings:read_robot_option",
    )
    registry.add(
        "axis_reference_node",
        "robotd_tool_space.nodes.axis_reference_node:AxisReferenceNode",
        summary="references of axes by the service of WMX R2",
        parameters="robotd.plugin.parameter_reader:no_parameters",
    )
