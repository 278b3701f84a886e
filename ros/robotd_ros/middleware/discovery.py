"""Discovery through a Fast DDS discovery server: the whole graph.

Works around: a client of such a server is told of the endpoints that match its own only.
Measured: without it `robotd status` does not find an action whose name it does not know.
Upstream: none: it is how a client of a discovery server is meant to work.
Shown by: tests/ros/test_discovery_server.py.
"""

from __future__ import annotations

import os


def discovery_server() -> str:
    """Addresses of the Fast DDS discovery servers in use; empty where discovery is by multicast."""
    return os.environ.get("ROS_DISCOVERY_SERVER", "")


def see_whole_graph() -> None:
    """Receive every endpoint under a discovery server. Call before ROS starts.

    A client of such a server sees the endpoints that match its own only: an action whose
    name is not known beforehand is never found. A super client sees all of them, at the
    price of a slower start (status: 4.0 s instead of 2.1 s on a busy machine), so only for
    processes that search the graph. Without a server this has no effect.
    """
    if discovery_server():
        os.environ.setdefault("ROS_SUPER_CLIENT", "TRUE")
