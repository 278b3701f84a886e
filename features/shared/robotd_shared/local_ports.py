"""Limits of what other programs ask of a port: connections, and headers of HTTP requests."""

from __future__ import annotations

MAX_CONNECTIONS = 64  # of each port: page, metrics, Foxglove, health
LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "[::1]"})


def rejection(host: str, origin: str | None) -> str:
    """Return why a request is rejected; "" where it is not.

    The Host check stops DNS rebinding: a foreign name that leads to the loopback interface. The
    Origin check stops pages of other servers. The port may differ from the server's own, so that
    a tunnel works.

    Args:
        host: Host header.
        origin: Origin header; None where the client sent none, as programs do.
    """
    name = host.rpartition(":")[0] if host.rpartition(":")[2].isdigit() else host
    if name.lower() not in LOOPBACK_NAMES:
        return f"host {host!r} is rejected: open http://localhost and the port"
    if origin is not None and origin != f"http://{host}":
        return f"origin {origin!r} is rejected: only the page itself may connect"
    return ""
