"""ROS interfaces of a robot's nodes, which are made but not started."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

with warnings.catch_warnings():  # rosidl imports an old lark
    warnings.simplefilter("ignore", DeprecationWarning)
    import rosidl_generator_py  # noqa: F401

from rclpy.node import Node

from robotd.cli.start_summary import ServeReport
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.node_factory import make_node
from robotd_ros.plugin import BUILT_IN
from robotd_ros.run_nodes import report_of


@contextmanager
def made_nodes(robot: Robot, *ros_args: str) -> Iterator[list[Node]]:
    """All nodes of the robot; ``ros_args`` are remaps and the like."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
        with RosHost(["--ros-args", *ros_args] if ros_args else [], domain_id=98) as host:
            nodes = []
            for name in robot.descriptor.nodes:
                nodes.append(make_node(name, BUILT_IN[name], robot, host))
                host.add_node(nodes[-1])
            yield nodes


def surface(robot: Robot, *ros_args: str) -> ServeReport:
    """Names and types of what all nodes of the robot offer."""
    with made_nodes(robot, *ros_args) as nodes:
        return report_of(nodes)
