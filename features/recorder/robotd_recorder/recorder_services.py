"""Services of the recorder on the node ``robotd``."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from std_srvs.srv import SetBool, Trigger

from robotd_recorder.recorder import Recorder
from robotd_ros.run_nodes import NodeContext
from robotd_ros.services import add_service


@contextmanager
def add_services(context: NodeContext, recorder: Recorder) -> Iterator[None]:
    """Add ``~/snapshot`` and ``~/record``."""

    def save_snapshot(request: Any, response: Any) -> str:
        return str(recorder.flight.snapshot("requested by a client"))

    def record(request: Any, response: Any) -> str:
        if request.data:
            recorder.continuous.start()
            return "recording"
        report = recorder.continuous.stop()
        return f"{report.path} ({report.size_bytes / 2**20:.1f} MiB)"

    add_service(context.operator, context.host, Trigger, "~/snapshot", save_snapshot)
    add_service(context.operator, context.host, SetBool, "~/record", record)
    yield
