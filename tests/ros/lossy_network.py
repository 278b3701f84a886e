"""Two computers and a switch between them that loses frames, as network namespaces.

The switch is a thread of this process: it reads Ethernet frames of a TAP device in each namespace
and writes them to the other one, except those that it loses.
"""

from __future__ import annotations

import fcntl
import os
import random
import select
import struct
import subprocess
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress

ROBOT, CLIENT = "10.250.8.1", "10.250.8.2"  # inside the namespaces only
ENVIRONMENT = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
TUNSETIFF, IFF_TAP, IFF_NO_PI = 0x400454CA, 0x0002, 0x1000  # linux/if_tun.h
MAX_FRAME_BYTES = 2048
IPV4, FRAGMENT = b"\x08\x00", 0x3FFF  # EtherType; "more fragments" and the offset
SHIELD = 'mount -t tmpfs shm /dev/shm && exec "$@"'


class LossySwitch:
    """Switch of two computers; ``loss`` may be changed while it runs.

    Attributes:
        loss: share of the frames that are lost, 0 to 1, in each direction.
        robot, client: words before a command that runs there.
        frames, fragments: frames so far, and those that are part of a longer IP datagram.
    """

    def __init__(self, loss: float, seed: int, namespaces: tuple[str, str]) -> None:
        self.loss = loss
        self.frames = self.fragments = 0
        self._random = random.Random(seed)
        self._ends: list[int] = []
        self._stop, self._stopped = os.pipe()
        # Without /dev/shm of the other: shared memory would bridge the switch.
        self.robot, self.client = (
            ["nsenter", f"--net=/run/netns/{name}", "unshare", "--mount", "sh", "-c", SHIELD, "sh"]
            for name in namespaces
        )
        for name, address in zip(namespaces, (ROBOT, CLIENT), strict=True):
            self._ends.append(_tap(name, address))
        self._thread = threading.Thread(target=self._run, name="lossy-switch", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread and remove the devices."""
        os.close(self._stopped)
        self._thread.join()
        for descriptor in (*self._ends, self._stop):
            os.close(descriptor)

    def _run(self) -> None:
        first, second = self._ends
        other = {first: second, second: first}
        while True:
            readable, _, _ = select.select([*self._ends, self._stop], [], [])
            if self._stop in readable:
                return
            for end in readable:
                frame = os.read(end, MAX_FRAME_BYTES)
                self.frames += 1
                self.fragments += _is_fragment(frame)
                if self._random.random() >= self.loss:
                    with suppress(OSError):  # the interface is down
                        os.write(other[end], frame)


def _is_fragment(frame: bytes) -> bool:
    (flags,) = struct.unpack_from("!H", frame, 20)
    return frame[12:14] == IPV4 and bool(flags & FRAGMENT)


def obstacle() -> str:
    """Return why this computer cannot make such a network; "" where it can."""
    try:
        with lossy_network(0.0):
            return ""
    except (OSError, subprocess.CalledProcessError) as error:
        return str(error)


@contextmanager
def lossy_network(loss: float, seed: int = 1) -> Iterator[LossySwitch]:
    """Make namespaces and switch, and remove them after the block.

    Raises CalledProcessError or OSError: this computer cannot.
    """
    names = (f"robotd-lossy-robot-{os.getpid()}", f"robotd-lossy-client-{os.getpid()}")
    with ExitStack() as made:
        for name in names:
            _run("ip", "netns", "add", name)
            made.callback(_run, "ip", "netns", "del", name)
            _run("ip", "-n", name, "link", "set", "lo", "up")
        switch = LossySwitch(loss, seed, names)
        made.callback(switch.close)
        yield switch


def _tap(namespace: str, address: str) -> int:
    """Return the descriptor of a TAP device ``eth`` in a namespace."""
    end = os.open("/dev/net/tun", os.O_RDWR)
    device = f"tap{os.getpid() % 10**6}{address[-1]}"
    fcntl.ioctl(end, TUNSETIFF, struct.pack("16sH", device.encode(), IFF_TAP | IFF_NO_PI))
    _run("ip", "link", "set", device, "netns", namespace)
    _run("ip", "-n", namespace, "link", "set", device, "name", "eth")
    _run("ip", "-n", namespace, "address", "add", f"{address}/24", "dev", "eth")
    _run("ip", "-n", namespace, "link", "set", "eth", "up")
    # As a second computer's default route: multicast leaves through it.
    _run("ip", "-n", namespace, "route", "add", "default", "dev", "eth")
    return end


def _run(*command: str) -> None:
    subprocess.run(command, check=True, capture_output=True, text=True)
