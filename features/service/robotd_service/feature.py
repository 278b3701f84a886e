"""Service as a feature: notifies the service manager, and serves the health for probes."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import TYPE_CHECKING

from pydantic import Field

from robotd.api import get_logger
from robotd.api.commands import PORT
from robotd.api.features import Feature, FeatureOption, Section

if TYPE_CHECKING:
    from wsgiref.types import StartResponse, WSGIEnvironment

    from robotd.api.features import FeatureHost
    from robotd_service.service_notifier import RobotProbe
log = get_logger("service")


class ServiceKeys(Section):
    """Keys at the top of a robot's file."""

    health: int | None = Field(
        None,
        ge=0,
        le=65535,
        description="Port of `/healthz` and `/readyz` on the loopback interface, for probes; 0: "
        "any free one; null: not served.",
    )


FEATURE = Feature(
    summary="notifications for systemd, and a health port for probes",
    settings=ServiceKeys,
    open="robotd_service.feature:open_service",
    options=(
        FeatureOption(
            "--health",
            "health",
            "Serve /healthz and /readyz for probes at http://127.0.0.1:PORT.",
            "PORT",
            PORT,
        ),
    ),
)


@contextmanager
def open_service(host: FeatureHost) -> Iterator[RobotProbe | None]:
    """Notify the service manager, and serve the health, where there is one.

    A manager that started this process is named in its environment, the port in the robot's file.
    The value is the probe; None without either.
    """
    from robotd_service.service_notifier import NotifySocket, RobotProbe, ServiceNotifier

    port = host.robot.descriptor.settings(ServiceKeys).health
    manager = NotifySocket.of_environment()
    if port is None and manager is None:
        yield None
        return
    probe = RobotProbe(host.robot, host.namespace)
    with ExitStack() as stack:
        if port is not None:
            from robotd_shared.local_http import serve_http

            served = stack.enter_context(serve_http(partial(answer, probe), port, "health"))
            log.info("health", url=f"http://127.0.0.1:{served}/healthz")
        if manager is not None:
            notifier = stack.enter_context(ServiceNotifier(manager, probe))
            host.on_served.append(notifier.ready)
        yield probe


def answer(
    probe: RobotProbe, environ: WSGIEnvironment, start_response: StartResponse
) -> Iterable[bytes]:
    """Answer an HTTP request: ``/healthz`` by ``alive``, ``/readyz`` by ``ready``."""
    path = environ.get("PATH_INFO", "")
    if path not in ("/healthz", "/readyz"):
        start_response("404 Not Found", [("Content-Type", "text/plain; charset=utf-8")])
        return [b"robotd: there are /healthz and /readyz\n"]
    found = probe.document()
    is_good = found["alive"] if path == "/healthz" else found["ready"]
    headers = [("Content-Type", "application/json"), ("Cache-Control", "no-store")]
    start_response("200 OK" if is_good else "503 Service Unavailable", headers)
    return [json.dumps(found).encode() + b"\n"]
