"""Router of Zenoh as the middleware of ROS: without it no process finds another one."""

from __future__ import annotations

import re
import socket
from collections.abc import Mapping
from contextlib import suppress

from robotd.api import Finding

ZENOH = "rmw_zenoh_cpp"
ROUTER = "tcp/localhost:7447"  # of a session without a configuration of the user's own
TIMEOUT_S = 1.0
_ENDPOINTS = re.compile(r"connect/endpoints\s*=\s*\[([^\]]*)\]|$")
_MULTICAST = re.compile(r"scouting/multicast/enabled\s*=\s*true")
_ADDRESS = re.compile(r"(?:tcp|tls)/\[?([^\]]+)\]?:(\d+)")


def zenoh_router(variables: Mapping[str, str]) -> Finding:
    """Look for a router where the sessions of ROS do."""
    override = variables.get("ZENOH_CONFIG_OVERRIDE", "")
    if _MULTICAST.search(override):
        return Finding("ok", "processes find each other by the multicast of Zenoh")
    given = _ENDPOINTS.search(override)
    endpoints = re.findall(r"\"([^\"]+)\"", given[1] or "") if given else []
    file = variables.get("ZENOH_SESSION_CONFIG_URI")
    if file and not endpoints:
        return Finding("ok", f"Zenoh is set by {file}: whether its router runs is not checked")
    for endpoint in endpoints or [ROUTER]:
        if _answers(endpoint):
            return Finding("ok", f"a Zenoh router is at {endpoint}")
    where = ", ".join(endpoints or [ROUTER])
    advice = (
        "start one: ros2 run rmw_zenoh_cpp rmw_zenohd; robotd docs how-to/several-computers says"
        " more"
    )
    return Finding("failed", f"no Zenoh router at {where}: no process finds another one", advice)


def _answers(endpoint: str) -> bool:
    address = _ADDRESS.match(endpoint)
    if address is None:
        return False
    with suppress(OSError), socket.create_connection((address[1], int(address[2])), TIMEOUT_S):
        return True
    return False
