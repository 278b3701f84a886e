"""Two computers on one switch, as network namespaces, and a link between them that can be cut."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

ROBOT, CLIENT = "10.250.7.1", "10.250.7.2"  # inside the namespaces only
# Shared memory would bridge the cut: both "computers" are this one.
ENVIRONMENT = {
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
    "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",
}
CUTS = {
    # The computers keep their carrier: the failure of a switch or of a radio further on.
    "switch": (
        ("{switch}", "link set dev client nomaster"),
        ("{switch}", "link set dev client master hub"),
    ),
    # The client's interface goes down: its cable is pulled.
    "interface": (("{client}", "link set eth down"), ("{client}", "link set eth up")),
}


class SplitNetwork:
    """Namespaces of a robot and of a client, joined by a switch in a third one.

    Attributes:
        robot, client: words before a command that runs there.
    """

    def __init__(self, names: dict[str, str]) -> None:
        self._names = names
        self.robot, self.client = (
            ["nsenter", f"--net=/run/netns/{names[side]}"] for side in ("robot", "client")
        )

    def cut(self, kind: str) -> None:
        """Cut the link between the two; ``kind`` of ``CUTS``."""
        self._run(*CUTS[kind][0])

    def heal(self, kind: str) -> None:
        """Join them again."""
        self._run(*CUTS[kind][1])

    def _run(self, place: str, command: str) -> None:
        _ip(place.format(**self._names), command)


def obstacle() -> str:
    """Return why this computer cannot make network namespaces; "" where it can."""
    for program in ("ip", "nsenter"):
        if shutil.which(program) is None:
            return f"no program {program}"
    if os.geteuid():
        return "network namespaces need root"
    try:
        with split_network():
            return ""
    except subprocess.CalledProcessError as error:
        return f"{' '.join(error.cmd)}: {error.stderr.strip()}"


@contextmanager
def split_network() -> Iterator[SplitNetwork]:
    """Make the namespaces and remove them after the block; raises CalledProcessError."""
    names = {side: f"robotd-{side}-{os.getpid()}" for side in ("switch", "robot", "client")}
    with ExitStack() as made:
        for name in names.values():
            _run("ip", "netns", "add", name)
            made.callback(_run, "ip", "netns", "del", name)
            _ip(name, "link set lo up")
        switch = names["switch"]
        _ip(switch, "link add name hub type bridge mcast_snooping 0")
        _ip(switch, "link set hub up")
        for side, address in (("robot", ROBOT), ("client", CLIENT)):
            _ip(switch, f"link add name {side} type veth peer name eth netns {names[side]}")
            _ip(switch, f"link set dev {side} master hub up")
            _ip(names[side], f"address add {address}/24 dev eth")
            _ip(names[side], "link set eth up")
        yield SplitNetwork(names)


def _ip(namespace: str, command: str) -> None:
    _run("ip", "-n", namespace, *command.split())


def _run(*command: str) -> None:
    subprocess.run(command, check=True, capture_output=True, text=True)
