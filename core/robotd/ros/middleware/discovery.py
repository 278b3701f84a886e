"""Discovery settings of Fast DDS: frequent announcements, and the whole graph from a server.

Works around: Fast DDS answers a new process once, in one case of three before that process listens.
The process then learns of robotd with the next periodic announcement, by default after up to 3 s.
Measured: from a client's start to its first service 0.08 s in two cases of three, else up to
2.7 s; announcing every 0.2 s ends that wait for every client (x86_64, quiet machine).
Upstream: https://github.com/ros2/rmw_fastrtps/issues/844 (the same 3 s; closed without a change).
Shown by: tests/ros/test_discovery_server.py, tools/bench/middleware.py.
"""

from __future__ import annotations

import os
from pathlib import Path

PROFILES = Path(__file__).with_name("fastdds.xml")

# Places where Fast DDS finds profiles of the user, which are never replaced.
_VARIABLES = ("FASTDDS_DEFAULT_PROFILES_FILE", "FASTRTPS_DEFAULT_PROFILES_FILE")
_FILE_HERE = "DEFAULT_FASTRTPS_PROFILES.xml"


def announce_often() -> None:
    """Set frequent announcements, unless the user has own profiles. Call before ROS starts.

    Other middlewares never read what this sets.
    """
    if any(os.environ.get(name) for name in _VARIABLES) or Path(_FILE_HERE).exists():
        return
    os.environ["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(PROFILES)


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
