"""Remapping (``-r``) of an action's name.

Works around: rcl of Jazzy remaps nodes, topics and services; an action's own services and topics
have other names (``NAME/_action/send_goal``), so that a rule for the action matches none of them.
Measured: nothing; one call for each action.
Upstream: https://github.com/ros2/ros2/issues/1312, done in later versions by
https://github.com/ros2/rcl/pull/1170.
Shown by: tests/ros/test_middleware.py.
"""

from __future__ import annotations

from rclpy.node import Node


def remapped_action(node: Node, name: str) -> str:
    """Full name of an action after the node's namespace and remapping rules.

    Raises the exceptions of ``Node.resolve_topic_name`` for a name that ROS does not allow.
    """
    return str(node.resolve_topic_name(name))
