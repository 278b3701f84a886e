"""Network of ROS as this computer has it: middleware, discovery, buffers, multicast, sockets."""

from __future__ import annotations

import os
import re
import socket
import struct
from collections.abc import Iterator
from pathlib import Path

from robotd.api import Finding, MachineContext
from robotd.api.commands import DEFAULT_MIDDLEWARE, domain_problem, middleware_problem
from robotd_doctor.computer_checks import read, tool
from robotd_doctor.zenoh_check import ZENOH, zenoh_router

SYSCTL, SOCKETS = Path("/proc/sys/net"), Path("/proc/net")
RECEIVE_BYTES = 2 * 2**20  # of a participant of an arm while a client of 500 Hz is discovered
DISCOVERY_GROUP = "239.255.0.1"  # of RTPS
MAX_DOMAIN = 101  # higher ones use the ephemeral ports of Linux
_MIDDLEWARE_ADVICE = (
    "unset RMW_IMPLEMENTATION; with an installed ROS also: sudo apt install ros-jazzy-{};"
    " the ROS wheels have Fast DDS only"
)
RTPS_PORTS = range(7400, 32767)
TCP_LISTEN = "0A"  # of linux/tcp_states.h
# 127.0.0.0/8, as IPv6 too, and ::1; words in the order of this computer's bytes.
LOOPBACK = re.compile("(0{16}FFFF0000)?[0-9A-F]{6}7F|0{24}01000000")


def check_network(context: MachineContext) -> Iterator[Finding]:
    """Yield the findings about the network."""
    yield from _variables()
    yield _receive_buffer()
    yield _multicast()
    yield from _links()
    yield from _sockets()


def _variables() -> Iterator[Finding]:
    variables = os.environ
    yield _domain(variables.get("ROS_DOMAIN_ID") or "0")
    middleware = variables.get("RMW_IMPLEMENTATION") or DEFAULT_MIDDLEWARE
    found = _middleware(middleware)
    yield found
    if middleware == ZENOH:
        if found.verdict != "failed":
            yield zenoh_router(variables)
        return  # it has no domain's ports, and other variables
    if server := variables.get("ROS_DISCOVERY_SERVER"):
        yield from _discovery_server(server)
        return
    extent = variables.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
    peers = variables.get("ROS_STATIC_PEERS", "")
    text = f"discovery range {extent}{f', static peers {peers}' if peers else ''}"
    if extent == "OFF" and not peers:
        advice = "no other process is found: export ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET"
        yield Finding("failed", text, advice)
    else:
        yield Finding("ok", text)
    for peer in filter(None, peers.split(";")):
        if not _resolves(peer):
            yield Finding("failed", f"static peer {peer!r} has no address", "correct its name")


def _domain(domain: str) -> Finding:
    problem = domain_problem()
    if not problem and int(domain) <= MAX_DOMAIN:
        return Finding("ok", f"ROS domain {domain}")
    advice = f"export ROS_DOMAIN_ID=N with N from 0 to {MAX_DOMAIN}"
    text = problem or f"ROS_DOMAIN_ID is {domain!r}: its ports are those that Linux gives to others"
    return Finding("failed", text, advice)


def _middleware(middleware: str) -> Finding:
    if problem := middleware_problem():
        return Finding("failed", problem, _MIDDLEWARE_ADVICE.format(middleware.replace("_", "-")))
    if middleware == DEFAULT_MIDDLEWARE:
        return Finding("ok", f"middleware {middleware}")
    advice = f"robotd is measured and tested with {DEFAULT_MIDDLEWARE}; all computers need the same"
    return Finding("warning", f"middleware {middleware}", advice)


def _discovery_server(servers: str) -> Iterator[Finding]:
    yield Finding("ok", f"discovery server {servers}")
    for server in filter(None, servers.split(";")):
        name = server.rpartition(":")[0] or server
        if not _resolves(name):
            yield Finding("failed", f"discovery server {name!r} has no address", "correct its name")


def _receive_buffer() -> Finding:
    limit = read(SYSCTL / "core/rmem_max")
    if not limit or int(limit) >= RECEIVE_BYTES:
        return Finding("ok", "receive buffers of UDP may be large enough")
    advice = (
        f"echo net.core.rmem_max={RECEIVE_BYTES} | sudo tee /etc/sysctl.d/60-robotd.conf;"
        " sudo sysctl --system"
    )
    text = f"receive buffers of UDP are limited to {int(limit) // 1024} kB: bursts are lost"
    return Finding("warning", text, advice)


def _multicast() -> Finding:
    """Send one datagram to a group and receive it; it leaves no interface."""
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
    ):
        receiver.settimeout(1.0)
        sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        try:
            receiver.bind(("", 0))
            membership = struct.pack("4sL", socket.inet_aton(DISCOVERY_GROUP), socket.INADDR_ANY)
            receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
            sender.sendto(b"robotd doctor", (DISCOVERY_GROUP, receiver.getsockname()[1]))
            receiver.recv(64)
        except OSError as error:
            advice = "sudo ip route add 239.0.0.0/8 dev INTERFACE, or ROS_STATIC_PEERS; firewall?"
            return Finding("warning", f"multicast does not work here: {error}", advice)
    return Finding("ok", "multicast works on this computer")


def _links() -> Iterator[Finding]:
    for path in sorted(Path("/sys/class/net").glob("*")):
        is_up = read(path / "operstate") == "up"
        if is_up and (path / "wireless").exists():
            power = tool("iw", "dev", path.name, "get", "power_save")
            advice = (
                f"sudo iw dev {path.name} set power_save off; see the page on several computers"
            )
            if "off" not in power:
                yield Finding("warning", f"{path.name} is Wi-Fi and may sleep", advice)
            else:
                yield Finding("ok", f"{path.name} is Wi-Fi, without power saving")


def _sockets() -> Iterator[Finding]:
    """TCP ports that other computers can reach; anything on them is not robotd's."""
    found = sorted({port for name in ("tcp", "tcp6") for port in _open_ports(SOCKETS / name)})
    if found:
        advice = "sudo ss -ltnp names the programs; robotd itself listens on 127.0.0.1 only"
        ports = ", ".join(map(str, found))
        yield Finding("ok", f"TCP ports that other computers can reach: {ports}", advice)
    else:
        yield Finding("ok", "no TCP port can be reached from other computers")
    udp = [line.split()[1] for line in _lines(SOCKETS / "udp")]
    in_use = sum(int(address.rpartition(":")[2], 16) in RTPS_PORTS for address in udp)
    yield Finding("ok", f"{in_use} UDP sockets in the range of ROS are in use")


def _open_ports(table: Path) -> Iterator[int]:
    for line in _lines(table):
        local, state = line.split()[1], line.split()[3]
        address, _, port = local.rpartition(":")
        if state == TCP_LISTEN and not LOOPBACK.fullmatch(address):
            yield int(port, 16)


def _lines(table: Path) -> list[str]:
    return [line for line in read(table).splitlines()[1:] if re.match(r"\s*\d+:", line)]


def _resolves(name: str) -> bool:
    try:
        socket.getaddrinfo(name, None)
    except OSError:
        return False
    return True
