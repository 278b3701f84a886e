"""Fast DDS in robotd's processes: announcements, lost messages, datagrams, memory, the whole graph.

Works around: Fast DDS answers a new process once, in one case of three before that process listens.
The process then learns of robotd with the next periodic announcement, by default after up to 3 s.
And it allocates 100 samples for each of the 240 endpoints of an arm, most of which are never used.
And each sample of a reliable topic wakes its event thread, which ends a period of 0 s in which the
writer ignores negative acknowledgements (``nack_supression_duration``).
And a lost message that none follows, a request or a response, is sent again when the next heartbeat
announces it: after up to 3 s.
Measured: from a client's start to its first service 0.08 s in two cases of three, else up to 2.7 s;
announcing every 0.2 s ends that wait for every client. With one sample for an endpoint, and more on
demand, the process has 11 MiB less. A sample is used again: periodic topics allocate nothing.
With 50 ms instead of 0 the event thread wakes 40 times a second and not 510 times, and the process
takes a third less of a core (x86_64, quiet machine). Where each twentieth datagram is lost, a
service takes as long as before, and of a topic at 500 Hz 5 % of the samples are lost instead of 3:
in a history of 10 samples few can be sent again in time.
At the same loss (UDP only) a call with a lost message takes 0.27 s (mean) with a heartbeat every
0.2 s at both ends, and 2.3 to 3.6 s with one every 3 s; without loss it is 5 wake-ups a second.
And it gathers the descriptions of endpoints in datagrams of 64 kB: 44 frames of Ethernet, all of
which have to arrive. With datagrams of one frame nothing but a lost frame is sent again.
At 5 % loss a new client knew the service ``robotd/stop`` after 2 to 34 s (median 19 s, 8 clients of
an arm), with 1400 bytes after 0.1 to 1.1 s (6 clients); without loss, start and processor time are
the same. Longer messages are sent in fragments, each in a datagram of its own.
And a client of a discovery server discovers the endpoints that match its own only, by design.
Without ``see_whole_graph`` `robotd status` does not find an action whose name it does not know.
Upstream: https://github.com/ros2/rmw_fastrtps/issues/844 (the same 3 s; closed without a change).
Ends with: no version yet.
Shown by: tools/bench/middleware.py, tests/ros/test_discovery_server.py.
"""

from __future__ import annotations

import os
from pathlib import Path

from robotd.cli.preflight import ROS_DISTRO

TRANSPORTS = "FASTDDS_BUILTIN_TRANSPORTS"
# A datagram in one Ethernet frame: 1500 bytes without the headers of IP and UDP, with a reserve.
MAX_DATAGRAM = "DEFAULT?max_msg_size=1400B"

PROFILES = Path(__file__).with_name("fastdds.xml")

# Places where Fast DDS finds profiles of the user, which are never replaced.
_VARIABLES = ("FASTDDS_DEFAULT_PROFILES_FILE", "FASTRTPS_DEFAULT_PROFILES_FILE")
_FILE_HERE = "DEFAULT_FASTRTPS_PROFILES.xml"


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


def use_profiles() -> None:
    """Use these profiles, unless the user has own ones. Call before ROS starts.

    A transport of the user's own is kept, too. Other middlewares never read what this sets. The
    profiles are in the words of Fast DDS 2, which Jazzy has; Fast DDS 3 rejects them.
    """
    os.environ.setdefault(TRANSPORTS, MAX_DATAGRAM)
    if os.environ.get("ROS_DISTRO", ROS_DISTRO) != ROS_DISTRO:
        return
    if any(os.environ.get(name) for name in _VARIABLES) or Path(_FILE_HERE).exists():
        return
    os.environ["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(PROFILES)
