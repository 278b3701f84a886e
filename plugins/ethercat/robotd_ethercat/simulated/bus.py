"""Bus: raw sockets at the ends of a line of slaves, in one thread."""

from __future__ import annotations

import select
import socket
import struct
import time
from collections.abc import Callable
from queue import Empty, SimpleQueue

from robotd_ethercat.simulated.datagrams import ETHERTYPE
from robotd_ethercat.simulated.line import Line, Port

_TICK_S = 0.005
_TICK_NS = 5_000_000
_RECEIVE_BUFFER = 4 << 20

Action = Callable[[], None]


class Bus:
    """Receives frames, sends them through the line, and returns them.

    ``run`` and the slaves belong to one thread; ``call`` may be used by any.

    Args:
        interface: where the master's frames arrive.
        secondary: interface of the other end of the line; None without redundancy.
    """

    def __init__(self, line: Line, interface: str, secondary: str | None = None) -> None:
        self.line = line
        self.frames = 0
        self._sockets = {Port.PRIMARY: raw_socket(interface)}
        if secondary is not None:
            self._sockets[Port.SECONDARY] = raw_socket(secondary)
        self._calls: SimpleQueue[Action] = SimpleQueue()
        self._ending = False

    def call(self, action: Action) -> None:
        """Run ``action`` in the thread of the bus, soon."""
        self._calls.put(action)

    def stop(self) -> None:
        """End ``run``, from any thread."""
        self._ending = True

    def run(self) -> None:
        """Serve frames until ``stop``."""
        poll = select.poll()
        ports = {end.fileno(): port for port, end in self._sockets.items()}
        for number in ports:
            poll.register(number, select.POLLIN)
        tick_ns = 0
        while not self._ending:
            for number, _ in poll.poll(_TICK_S * 1000):
                self._receive(ports[number])
            now_ns = time.monotonic_ns()
            if now_ns - tick_ns >= _TICK_NS:
                self._run_calls()
                self.line.tick(now_ns)
                tick_ns = now_ns

    def close(self) -> None:
        """Close the sockets."""
        for end in self._sockets.values():
            end.close()

    def _receive(self, port: Port) -> None:
        line = self.line
        try:
            length = self._sockets[port].recv_into(line.buffer)
        except OSError:  # the interface is down, or there is no frame
            return
        now_ns = time.monotonic_ns()
        leaves = line.forward(length, now_ns, port)
        if leaves is not None:
            self._send(leaves, length)
        self.frames += 1
        line.service(now_ns)

    def _send(self, port: Port, length: int) -> None:
        try:
            self._sockets[port].send(self.line.buffer[:length])
        except OSError:
            return  # the interface is down, as a cable that is not connected

    def _run_calls(self) -> None:
        while True:
            try:
                action = self._calls.get_nowait()
            except Empty:
                return
            action()


def raw_socket(interface: str) -> socket.socket:
    """Open a non-blocking raw socket for EtherCAT frames. Raises OSError."""
    end = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETHERTYPE))
    end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
    end.bind((interface, ETHERTYPE))
    index = socket.if_nametoindex(interface)
    promiscuous = struct.pack("=iHH8s", index, 1, 0, bytes(8))
    end.setsockopt(263, 1, promiscuous)  # SOL_PACKET, PACKET_ADD_MEMBERSHIP: any address
    end.setblocking(False)
    return end
