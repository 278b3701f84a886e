"""Network interfaces of the bus, and the raw sockets that SOEM opens on them (Linux)."""

from __future__ import annotations

import fcntl
import os
import socket
import stat
import struct
import termios
from collections.abc import Sequence
from pathlib import Path

_GET_FLAGS, _UP = 0x8913, 1  # ioctl SIOCGIFFLAGS, IFF_UP
_REQUEST = struct.Struct("=16sH22x")
_COUNT = struct.Struct("=i")


def problem_of(interfaces: Sequence[str]) -> tuple[str, bool]:
    """Return why ``interfaces`` cannot be used, and whether that stays so; "" if they can."""
    known = [name for _, name in socket.if_nameindex()]
    for name in interfaces:
        if name not in known:
            return f"there is no interface {name!r} (available: {', '.join(known)})", True
        if not _is_up(name):
            return f"{name} is down: sudo ip link set {name} up", False
    if not may_open_raw_sockets():
        text = "no permission for raw sockets: run as root, or grant the process CAP_NET_RAW, see"
        return f"{text} robotd docs how-to/ethercat", True
    return "", False


def may_open_raw_sockets() -> bool:
    """Return True with root's rights, or with CAP_NET_RAW."""
    try:
        socket.socket(socket.AF_PACKET, socket.SOCK_RAW).close()
    except PermissionError:
        return False
    return True


def _is_up(interface: str) -> bool:
    """Return True for an interface that is switched on, with a cable or without."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        answer = fcntl.ioctl(any_socket, _GET_FLAGS, _REQUEST.pack(interface.encode(), 0))
    return bool(_REQUEST.unpack(answer)[1] & _UP)


def raw_sockets() -> set[int]:
    """Return the descriptors of all raw sockets of this process."""
    found = set()
    for descriptor in [int(entry.name) for entry in Path("/proc/self/fd").iterdir()]:
        try:
            if stat.S_ISSOCK(os.fstat(descriptor).st_mode):
                with socket.socket(fileno=os.dup(descriptor)) as one:
                    if one.family == socket.AF_PACKET:
                        found.add(descriptor)
        except OSError:  # closed meanwhile
            continue
    return found


def unsent_bytes(packet_socket: socket.socket) -> int:
    """Return the memory of frames that the interface has not sent yet; 0: none.

    The kernel counts a frame until the network driver has done with it.
    """
    answer = fcntl.ioctl(packet_socket.fileno(), termios.TIOCOUTQ, bytes(_COUNT.size))
    return int(_COUNT.unpack(answer)[0])


def prepared(descriptor: int) -> socket.socket:
    """Make SOEM poll a socket that started programs do not inherit; return a copy.

    It limits each ``recv`` to 1 µs, which the kernel rounds up to its timer tick: a lost frame held
    up the control loop for 5.8 ms (measured at 250 ticks/s, with a time-out of 0.1 ms). A socket
    that does not block returns at once, and SOEM repeats until its own time-out.
    """
    os.set_inheritable(descriptor, False)
    copy = socket.socket(fileno=os.dup(descriptor))
    copy.setblocking(False)
    return copy
