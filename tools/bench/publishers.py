"""Baselines in Python, as processes: ``python -m tools.bench.publishers timer|thread RATE_HZ``.

They publish what the daemon publishes. ``timer`` is the node that one writes first: a timer, new
messages, the SingleThreadedExecutor. ``thread`` is the least that Python needs: an absolute sleep
in a thread of its own and bytes that were serialized once, with nothing but the stamp changing.
"""

from __future__ import annotations

import ctypes
import os
import struct
import sys
import threading
import time
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from tools.bench.topics import AXIS_STATE, AXIS_STATE_HZ, COMMANDS, JOINT_STATES, STAMP_OFFSET
from wmx_ros2_message.msg import AxisState

from robotd.realtime import request_realtime

AXES = 6
NAMES = [*(f"joint{number}" for number in range(1, 7)), "picker_1_joint", "picker_2_joint"]
FLAGS = ("amp_alarm", "servo_on", "home_done", "home_switch", "negative_ls", "positive_ls")
VALUES = ("pos_cmd", "velocity_cmd", "actual_pos", "actual_velocity", "actual_torque")
PR_SET_TIMERSLACK = 29
PRIORITY = 60


class Baseline(Node):
    """The three topics and a service."""

    def __init__(self, rate_hz: int) -> None:
        super().__init__("baseline")
        self.rate_hz = rate_hz
        self.axis_every = round(rate_hz / AXIS_STATE_HZ)
        self.count = 0
        self.joint_states = self.create_publisher(JointState, JOINT_STATES, 10)
        self.commands = self.create_publisher(Float64MultiArray, COMMANDS, 10)
        self.axis_state = self.create_publisher(AxisState, AXIS_STATE, 10)
        self.create_service(Trigger, "/baseline/trigger", answer)

    def publish_new(self) -> None:
        """The callback of the timer."""
        numbers = [float(self.count + joint) for joint in range(len(NAMES))]
        message = joint_state(numbers)
        message.header.stamp = self.get_clock().now().to_msg()
        self.joint_states.publish(message)
        self.commands.publish(Float64MultiArray(data=numbers))
        if self.count % self.axis_every == 0:
            axes = axis_state(numbers[:AXES])
            axes.header.stamp = self.get_clock().now().to_msg()
            self.axis_state.publish(axes)
        self.count += 1

    def publish_kept(self) -> None:
        """The body of the thread; ends with the process."""
        prepare_thread()
        numbers = [0.0] * len(NAMES)
        joints = bytearray(serialize_message(joint_state(numbers)))
        commands = serialize_message(Float64MultiArray(data=numbers))
        axes = bytearray(serialize_message(axis_state(numbers[:AXES])))
        period_ns = 1_000_000_000 // self.rate_hz
        deadline_ns = time.monotonic_ns() + period_ns
        while rclpy.ok():
            time.sleep(max(0, deadline_ns - time.monotonic_ns()) * 1e-9)
            stamp = divmod(time.time_ns(), 1_000_000_000)
            struct.pack_into("<iI", joints, STAMP_OFFSET, *stamp)
            self.joint_states.publish(bytes(joints))
            self.commands.publish(commands)
            if self.count % self.axis_every == 0:
                struct.pack_into("<iI", axes, STAMP_OFFSET, *stamp)
                self.axis_state.publish(bytes(axes))
            self.count += 1
            late_ns = time.monotonic_ns() - deadline_ns
            deadline_ns += (max(0, late_ns) // period_ns + 1) * period_ns


def joint_state(numbers: list[float]) -> Any:
    return JointState(name=NAMES, position=numbers, velocity=numbers, effort=numbers)


def axis_state(numbers: list[float]) -> Any:
    flags = {name: [True] * AXES for name in (*FLAGS, "motion_complete")}
    message = AxisState(**flags, **dict.fromkeys(VALUES, numbers))
    message.header.frame_id = "base_link"
    return message


def answer(request: Any, response: Any) -> Any:
    response.success = True
    response.message = "Communicating"
    return response


def prepare_thread() -> None:
    """Set timer slack and priority as the daemon's cycle has them, for comparison."""
    ctypes.CDLL(None).prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0)
    request_realtime(PRIORITY)


def main(kind: str, rate_hz: int) -> None:
    rclpy.init()
    node = Baseline(rate_hz)
    if kind == "timer":
        node.create_timer(1.0 / rate_hz, node.publish_new)
    else:
        threading.Thread(target=node.publish_kept, daemon=True).start()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        os._exit(0)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
