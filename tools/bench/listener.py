"""The subscriber of every measurement: ``python -m tools.bench.listener FILE``, until SIGTERM.

Subscribes the joint states and the axis state raw, so that its own cost is as small as Python
allows, and writes when each joint state arrived and when it was stamped.
"""

from __future__ import annotations

import signal
import struct
import sys
import threading
import time
from array import array
from pathlib import Path

import numpy as np
import rclpy
from sensor_msgs.msg import JointState
from tools.bench.topics import AXIS_STATE, JOINT_STATES, STAMP_OFFSET
from wmx_ros2_message.msg import AxisState

from robotd_ros.host import RosHost

STAMP = struct.Struct("<iI")
NANOSECONDS = 1_000_000_000


class Listener:
    """Three times of every joint state, in ns: arrival on both clocks, and the stamp."""

    def __init__(self) -> None:
        self.arrived = array("q")
        self.arrived_wall = array("q")
        self.stamped = array("q")

    def on_joint_state(self, message: bytes) -> None:
        wall, now = time.time_ns(), time.monotonic_ns()
        sec, nanosec = STAMP.unpack_from(message, STAMP_OFFSET)
        if not self.arrived:
            print("first", flush=True)
        self.arrived_wall.append(wall)
        self.arrived.append(now)
        self.stamped.append(sec * NANOSECONDS + nanosec)

    def on_axis_state(self, message: bytes) -> None:
        """Received and dropped, as a part of the load."""

    def write(self, path: Path) -> None:
        count = min(map(len, (self.arrived, self.arrived_wall, self.stamped)))
        np.savez(
            path,
            arrived_ns=np.array(self.arrived[:count]),
            arrived_wall_ns=np.array(self.arrived_wall[:count]),
            stamped_ns=np.array(self.stamped[:count]),
        )


def main(path: Path) -> None:
    stop = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: stop.set())
    listener = Listener()
    with RosHost() as host:
        node = rclpy.create_node("listener", context=host.context)
        host.add_node(node)
        node.create_subscription(JointState, JOINT_STATES, listener.on_joint_state, 10, raw=True)
        node.create_subscription(AxisState, AXIS_STATE, listener.on_axis_state, 10, raw=True)
        print("listening", flush=True)
        stop.wait()
    listener.write(path)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
