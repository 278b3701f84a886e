"""The port in front of foxglove-sdk, with a server that echoes."""

from __future__ import annotations

import socket
import socketserver
import threading
from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from robotd.clock import MonotonicClock, wait_until
from robotd_foxglove import limited_port
from robotd_foxglove.limited_port import LimitedPort
from robotd_shared.local_http import MAX_CONNECTIONS

BLOCK = bytes(range(256)) * 1000


class Echo(socketserver.BaseRequestHandler):
    def handle(self) -> None:
        while block := self.request.recv(65536):
            self.request.sendall(block)


@pytest.fixture
def port() -> Iterator[int]:
    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Echo) as server:
        server.daemon_threads = True
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        limited = LimitedPort(0, server.server_address[1])
        limited.start()
        yield limited.number
        limited.stop()
        server.shutdown()
        thread.join()
    names = [thread.name for thread in threading.enumerate()]
    assert "robotd-foxglove-port" not in names


def connect(port: int) -> socket.socket:
    return socket.create_connection(("127.0.0.1", port), timeout=10)


def echoes(port: int) -> bool:
    try:
        with connect(port) as client:
            sender = threading.Thread(target=client.sendall, args=(BLOCK,))
            sender.start()
            received = b""
            while len(received) < len(BLOCK) and (block := client.recv(65536)):
                received += block
            sender.join()
    except OSError:
        return False
    return received == BLOCK


def test_both_directions_are_passed_on(port: int) -> None:
    assert echoes(port)


def test_connections_beyond_the_limit_are_closed(port: int) -> None:
    with ExitStack() as stack:
        silent = [stack.enter_context(connect(port)) for _ in range(MAX_CONNECTIONS)]
        with connect(port) as another:
            assert another.recv(1) == b""
        silent[0].close()
        assert wait_until(lambda: echoes(port), 10.0, MonotonicClock(), 0.02)


def test_a_connection_that_sends_nothing_is_closed(
    port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limited_port, "FIRST_TIMEOUT_S", 0.05)
    with connect(port) as silent:
        assert silent.recv(1) == b""
