"""Named inputs and outputs: latched topics, and services to set outputs."""

from __future__ import annotations

from functools import partial
from typing import Any

from rclpy.node import Node
from std_msgs.msg import Bool, String
from std_srvs.srv import SetBool

from robotd.device.process_image import ProcessImage
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.nodes.latched_topics import publish_if_alive
from robotd_ros.qos import LATCHED
from robotd_ros.services import add_service

TOPIC = "~/io"
RATE_HZ = 50.0
WORDS = {True: "on", False: "off", None: "unknown"}


class NamedIo:
    """``~/inputs/NAME`` and ``~/outputs/NAME`` of the names in the descriptor.

    A topic has the level on every change, while the device communicates. ``~/io`` has all of them
    as text, a line each: ``input part_present: on``.
    """

    def __init__(self, node: Node, robot: Robot, host: RosHost) -> None:
        self._io, self._connection = robot.io, robot.connection
        self._overview = node.create_publisher(String, TOPIC, LATCHED)
        io = robot.io
        self._readers = {("input", name): io.input_watcher(*io.inputs[name]) for name in io.inputs}
        self._readers |= {
            ("output", name): io.output_watcher(*io.outputs[name]) for name in io.outputs
        }
        self._publishers = {
            (kind, name): node.create_publisher(Bool, f"~/{kind}s/{name}", LATCHED)
            for kind, name in self._readers
        }
        self._levels: dict[tuple[str, str], bool | None] | None = None  # not published yet
        for name in io.outputs:
            handler = partial(self._set, name)
            add_service(node, host, SetBool, f"~/outputs/{name}", handler)
        rate_hz = min(RATE_HZ, robot.descriptor.cycle.rate_hz)
        robot.control_loop.every(rate_hz, "named I/O", self.publish, first=True)

    def publish(self, image: ProcessImage) -> None:
        """Publish the levels that have changed. Control loop."""
        ready = self._connection.ready
        levels = {key: read() if ready else None for key, read in self._readers.items()}
        if levels == self._levels:
            return
        before, self._levels = self._levels or {}, levels
        for key, level in levels.items():
            if level is not None and level != before.get(key):
                publish_if_alive(self._publishers[key], Bool(data=level))
        lines = (f"{kind} {name}: {WORDS[level]}" for (kind, name), level in levels.items())
        publish_if_alive(self._overview, String(data="\n".join(lines)))

    def _set(self, name: str, request: Any, response: Any) -> str:
        self._io.set_output(name, request.data)
        return f"{name}: {WORDS[bool(request.data)]}"
