"""The topic wmx/axis/state: all axes of the robot, published by the cycle."""

from __future__ import annotations

from rclpy.node import Node
from std_msgs.msg import Header
from wmx_ros2_message.msg import AxisState

from robotd.device.engine import Engine
from robotd.device.image import FLAGS, VALUES, ProcessImage, columns
from robotd.ros.cdr import HotPublisher, stamp_ns

TOPIC = "wmx/axis/state"
RATE_HZ = 100.0
FRAME = "base_link"
DEPTH = 10

# Field of the message → array of the process image.
FLAG_FIELDS = {
    "amp_alarm": "amp_alarm",
    "servo_on": "servo_on",
    "home_done": "home_done",
    "home_switch": "home_switch",
    "negative_ls": "negative_limit",
    "positive_ls": "positive_limit",
    "motion_complete": "motion_complete",
}
VALUE_FIELDS = {
    "pos_cmd": "position_command",
    "velocity_cmd": "velocity_command",
    "actual_pos": "position",
    "actual_velocity": "velocity",
    "actual_torque": "torque",
}


class AxisStateTopic:
    """Made in any thread; ``publish`` belongs to the cycle.

    Nothing is published while the engine is not ready: old values must not look alive.

    Attributes:
        topic: its resolved name.
    """

    def __init__(self, node: Node, axes: int, engine: Engine) -> None:
        template = AxisState(
            header=Header(frame_id=FRAME),
            **{field: [False] * axes for field in FLAG_FIELDS},
            **{field: [0.0] * axes for field in VALUE_FIELDS},
        )
        flags, values = tuple(FLAG_FIELDS), tuple(VALUE_FIELDS)
        publisher = node.create_publisher(AxisState, TOPIC, DEPTH)
        self.topic = publisher.topic_name
        self._engine = engine
        self._clock = node.get_clock()
        self._message = HotPublisher(publisher, template, [flags, values])
        self._flags, self._values = self._message.view(flags), self._message.view(values)
        self._flag_rows = columns([FLAGS.index(array) for array in FLAG_FIELDS.values()])
        self._value_rows = columns([VALUES.index(array) for array in VALUE_FIELDS.values()])

    def publish(self, image: ProcessImage) -> None:
        if not self._engine.ready:
            return
        self._flags[:] = image.flags[self._flag_rows]
        self._values[:] = image.values[self._value_rows]
        self._message.stamp(stamp_ns(self._clock))
        self._message.publish()
