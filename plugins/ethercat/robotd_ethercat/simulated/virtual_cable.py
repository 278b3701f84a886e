"""Pairs of virtual Ethernet interfaces in a network namespace of their own (Linux)."""

from __future__ import annotations

import ctypes
import fcntl
import os
import socket
import struct
from pathlib import Path

_CLONE_NEWUSER, _CLONE_NEWNET = 0x1000_0000, 0x4000_0000
_NEWLINK, _ERROR = 16, 2
_REQUEST, _ACK, _CREATE, _EXCLUSIVE = 0x01, 0x04, 0x400, 0x200
_IFLA_NAME, _IFLA_LINKINFO, _INFO_KIND, _INFO_DATA, _VETH_PEER = 3, 18, 1, 2, 1
_GET_FLAGS, _SET_FLAGS = 0x8913, 0x8914  # ioctl SIOCGIFFLAGS, SIOCSIFFLAGS
_UP = 1
_REQUEST_SIZE = 40
_HEADER, _LINK = struct.Struct("=IHHII"), struct.Struct("=BxHiII")


def new_namespace() -> None:
    """Move the calling process to a new network namespace.

    Without root this needs a user namespace, and a process with one thread alone. Raises OSError.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.unshare(_CLONE_NEWNET) == 0:
        return
    user, group = os.geteuid(), os.getegid()
    if libc.unshare(_CLONE_NEWUSER | _CLONE_NEWNET) != 0:
        code = ctypes.get_errno()
        raise OSError(code, f"no network namespace can be made: {os.strerror(code)}")
    Path("/proc/self/setgroups").write_text("deny", encoding="ascii")
    Path("/proc/self/uid_map").write_text(f"{user} {user} 1", encoding="ascii")
    Path("/proc/self/gid_map").write_text(f"{group} {group} 1", encoding="ascii")


def make_cable(one: str, other: str) -> None:
    """Make two interfaces connected with each other, both up. Raises OSError."""
    peer = _LINK.pack(0, 0, 0, 0, 0) + _attribute(_IFLA_NAME, other.encode() + b"\0")
    data = _attribute(_INFO_DATA, _attribute(_VETH_PEER, peer))
    info = _attribute(_IFLA_LINKINFO, _attribute(_INFO_KIND, b"veth") + data)
    link = _LINK.pack(0, 0, 0, 0, 0) + _attribute(_IFLA_NAME, one.encode() + b"\0") + info
    flags = _REQUEST | _ACK | _CREATE | _EXCLUSIVE
    message = _HEADER.pack(_HEADER.size + len(link), _NEWLINK, flags, 1, 0) + link
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, socket.NETLINK_ROUTE) as netlink:
        netlink.bind((0, 0))
        netlink.send(message)
        answer = netlink.recv(65536)
    _, kind, _, _, _ = _HEADER.unpack_from(answer)
    code = -struct.unpack_from("=i", answer, _HEADER.size)[0] if kind == _ERROR else 0
    if code:
        raise OSError(code, f"no virtual cable {one} – {other}: {os.strerror(code)}")
    for name in (one, other):
        _set_up(name)


def _set_up(interface: str) -> None:
    request = struct.pack("=16sH", interface.encode(), 0).ljust(_REQUEST_SIZE, b"\0")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        flags = struct.unpack_from("=H", fcntl.ioctl(any_socket, _GET_FLAGS, request), 16)[0]
        request = struct.pack("=16sH", interface.encode(), flags | _UP)
        fcntl.ioctl(any_socket, _SET_FLAGS, request.ljust(_REQUEST_SIZE, b"\0"))


def _attribute(kind: int, data: bytes) -> bytes:
    """Encode a netlink attribute, padded to 4 bytes."""
    length = 4 + len(data)
    return struct.pack("=HH", length, kind) + data + bytes(-length % 4)
