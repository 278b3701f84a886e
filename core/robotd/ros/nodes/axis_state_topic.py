"""Topic wmx/axis/state: all axes of the robot, published by the control loop."""

from __future__ import annotations

import numpy as np
from rclpy.node import Node
from std_msgs.msg import Header
from wmx_ros2_message.msg import AxisState

from robotd.device.process_image import ProcessImage
from robotd.robot import Robot
from robotd.ros.middleware import HotPublisher, StampClock

TOPIC = "wmx/axis/state"
RATE_HZ = 100.0
FRAME = "base_link"
DEPTH = 10

# Field of the message → array of the process image.
FIELDS = {
    "amp_alarm": "amp_alarm",
    "servo_on": "servo_on",
    "home_done": "home_done",
    "home_switch": "home_switch",
    "negative_ls": "negative_limit",
    "positive_ls": "positive_limit",
    "motion_complete": "motion_complete",
    "pos_cmd": "position_command",
    "velocity_cmd": "velocity_command",
    "actual_pos": "position",
    "actual_velocity": "velocity",
    "actual_torque": "torque",
}


class AxisStateTopic:
    """Made in any thread; ``publish`` belongs to the control loop.

    Nothing is published without subscribers, nor while the engine is not ready: old values
    must not look current.

    Args:
        prefix: put before the name of the frame.

    Attributes:
        topic: its resolved name.
    """

    def __init__(self, node: Node, robot: Robot, prefix: str) -> None:
        arrays = {field: getattr(robot.image, name) for field, name in FIELDS.items()}
        zeros = {field: np.zeros_like(array).tolist() for field, array in arrays.items()}
        template = AxisState(header=Header(frame_id=prefix + FRAME), **zeros)
        self._connection, self._control_loop = robot.connection, robot.control_loop
        self._clock = StampClock(node.get_clock())
        self._message = HotPublisher(node, TOPIC, DEPTH, template, sources=arrays)
        self.topic = self._message.topic

    def publish(self, image: ProcessImage) -> None:
        if not self._connection.ready or not self._message.has_readers:
            return
        self._message.stamp(self._clock.at_ns(self._control_loop.started_ns))
        self._message.publish()
