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

    def snapshot(request: Any, response: Any) -> Any:
        response.message = str(recorder.flight.snapshot("requested by a client"))
        response.success = True
        return response

    def record(request: Any, response: Any) -> Any:
        if request.data:
            recorder.continuous.start()
            response.message = "recording"
        else:
            report = recorder.continuous.stop()
            size_mib = report.size_bytes / 2**20
            response.message = f"{report.path} ({size_mib:.1f} MiB)"
        response.success = True
        return response

    add_service(node, host, Trigger, SNAPSHOT, snapshot)
    add_service(node, host, SetBool, RECORD, record)
