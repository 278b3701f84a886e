"""Names for authors of ROS nodes, in plugins and backends. Importing it imports rclpy.

A node is a class derived from ``rclpy.node.Node`` with ``context=host.context``, made as
``Node(robot, host)`` and registered by the hook ``robotd_register_nodes``. A node of a backend
reaches its device by ``robot.device``.
"""

from robotd.clock.simulated import ticks, untimed
from robotd.errors import (
    DescriptorError,
    InvalidArgument,
    NotReady,
    OperationError,
    RobotdError,
    Unsupported,
)
from robotd.plugin.parameter_reader import ParameterReader, no_parameters
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.middleware import HotPublisher, StampClock
from robotd_ros.nodes.command_subscription import add_command_subscription
from robotd_ros.nodes.node_parameters import read_settings
from robotd_ros.nodes.topic_stream import TopicStream
from robotd_ros.qos import LATCHED, STREAM
from robotd_ros.run_nodes import NodeContext
from robotd_ros.services import add_service, add_subscription

__all__ = [
    "LATCHED",
    "STREAM",
    "DescriptorError",
    "HotPublisher",
    "InvalidArgument",
    "NodeContext",
    "NotReady",
    "OperationError",
    "ParameterReader",
    "Robot",
    "RobotdError",
    "RosHost",
    "StampClock",
    "TopicStream",
    "Unsupported",
    "add_command_subscription",
    "add_service",
    "add_subscription",
    "no_parameters",
    "read_settings",
    "ticks",
    "untimed",
]
