"""Tool space as a feature: keys of the robot's file, ``robot.tool``, services, and a node.

Imports no ROS.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from robotd.api import hookimpl
from robotd.api.features import Feature
from robotd_tool_space.settings import ToolSpaceKeys

if TYPE_CHECKING:  # every command that reads a robot's file imports this module
    from robotd.api import NodeRegistry
    from robotd.api.features import FeatureHost

FEATURE = Feature(
    summary="motion of the tool: poses, straight lines, kinematics, tool and work frames",
    settings=ToolSpaceKeys,
    open="robotd_tool_space.feature:open_tool_space",
    nodes="robotd_tool_space.tool_nodes:add_tool_nodes",
    attributes={
        "tool": "robotd_tool_space.tool_groups:only_tool",
        "tool_groups": "robotd_tool_space.tool_groups:ToolGroups",
        "reduced_speed": "robotd_tool_space.reduced_speed:ReducedSpeed",
        "collision_guard": "robotd_tool_space.collision_guard:CollisionGuard",
    },
)


@contextmanager
def open_tool_space(host: FeatureHost) -> Iterator[object | None]:
    """Return the tools of a robot; None where it has none."""
    from robotd_tool_space.tool_groups import tool_groups

    settings = host.robot.descriptor.settings(ToolSpaceKeys).tool_space
    needed = settings.reduced_speed_input is not None or settings.collisions is not None
    if not host.robot.tools and not needed:
        yield None
        return
    groups = tool_groups(host.robot)
    if groups or needed:  # from the start; an error where they cannot be
        host.robot.attribute("reduced_speed")
        if settings.collisions is not None:
            host.robot.attribute("collision_guard")
    yield groups or None


@hookimpl
def robotd_register_nodes(registry: NodeRegistry) -> None:
    """Add the nodes that a robot lists to have them."""
    registry.add(
        "servo_node",
        "robotd_tool_space.servo_node:ServoNode",
        summary="motion of the tool on topics: twists and poses, as MoveIt Servo takes them",
        parameters="robotd_tool_space.node_settings:read_servo",
    )
    registry.add(
        "wmx_robot_option_node",
        "robotd_tool_space.r2_node:WmxRobotOptionNode",
        summary="motion of the whole robot by services, as WMX R2 has it",
        parameters="robotd_tool_space.node_settings:read_robot_option",
    )
    registry.add(
        "axis_reference_node",
        "robotd_tool_space.axis_reference_node:AxisReferenceNode",
        summary="references of axes by the service of WMX R2",
        parameters="robotd.plugin.parameter_reader:no_parameters",
    )
