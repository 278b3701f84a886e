"""Services of the recorder, on the node ``robotd``."""

from __future__ import annotations

from typing import Any

from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from robotd.observation.recorder import Recorder
from robotd.ros.host import RosHost
from robotd.ros.services import add_service

SNAPSHOT = "~/snapshot"
RECORD = "~/record"


def add_recorder_services(node: Node, host: RosHost, recorder: Recorder) -> None:
    """Add ``snapshot`` and ``record`` to ``node``; the answers name the file."""

    def snapshot(request: Any, response: Any) -> str:
        return str(recorder.flight.snapshot("requested by a client"))

    def record(request: Any, response: Any) -> str:
        if request.data:
            recorder.continuous.start()
            return "recording"
        report = recorder.continuous.stop()
        return f"{report.path} ({report.size_bytes / 2**20:.1f} MiB)"

    add_service(node, host, Trigger, SNAPSHOT, snapshot)
    add_service(node, host, SetBool, RECORD, record)
