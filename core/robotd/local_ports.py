"""Limits of what other programs ask of a port: connections, and headers of HTTP requests."""

from __future__ import annotations

import resource

from robotd.log import get_logger

log = get_logger("serve")

MAX_CONNECTIONS = 64  # of each port: page, metrics, Foxglove, health
MAX_FILES = 512  # of a process with every port full, its recorder and its bus included
LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "[::1]"})


def reserve_files() -> None:
    """Raise the limit of open files to what a recording needs beside full ports.

    Logs a warning where the system does not allow as many.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != resource.RLIM_INFINITY and soft < MAX_FILES:
        allowed = MAX_FILES if hard == resource.RLIM_INFINITY else min(MAX_FILES, hard)
        resource.setrlimit(resource.RLIMIT_NOFILE, (allowed, hard))
        if allowed < MAX_FILES:
            log.warning(
                "few open files are allowed: clients of the ports could end a recording",
                limit=allowed,
                needed=MAX_FILES,
                advice=f"ulimit -n {MAX_FILES}",
            )


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
