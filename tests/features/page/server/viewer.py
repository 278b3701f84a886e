"""A page's server for a simulated arm in stepped time, and viewers of it."""

from __future__ import annotations

import asyncio
import json
import socket
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import aiohttp
import numpy as np
from tests.features.harness import Observed

from robotd_page.control_server import PageControl
from robotd_page.live_samples import HEADER
from robotd_page.page_feed import RobotSource
from robotd_page.page_server import PageServer
from robotd_scenario.fault_schedule import FaultSchedule, RequestedFaults

TIMEOUT_S = 30.0  # far longer than on an idle computer


def wait_until(condition: Callable[[], Any]) -> None:
    """Poll ``condition`` until it holds."""
    deadline_s = time.monotonic() + TIMEOUT_S
    while not condition():
        assert time.monotonic() < deadline_s, "timeout"
        time.sleep(0.01)


@contextmanager
def served_page(folder: Path, **options: Any) -> Iterator[tuple[Observed, PageServer]]:
    """An arm whose page is served at any free port; with ``has_control`` it takes commands."""
    arm = Observed(folder, robot=options.pop("robot", "cr3a"))
    nodes = options.pop("nodes", ["first_node", "second_node"])
    has_control = options.pop("has_control", False)
    source = RobotSource(arm.tap, nodes, has_control=has_control)
    if has_control:
        options["control"] = PageControl(arm.robot, RequestedFaults(FaultSchedule(arm.robot)))
    try:
        with PageServer(source, 0, **options) as server:
            yield arm, server
    finally:
        arm.close()


class Viewer:
    """WebSocket client that keeps what it has received."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self.socket = socket
        self.description: dict[str, Any] = {}
        self.state: dict[str, Any] = {}
        self.events: list[dict[str, Any]] = []
        self.samples: list[np.ndarray] = []

    async def receive(self) -> aiohttp.WSMessage:
        message = await self.socket.receive(TIMEOUT_S)
        if message.type is aiohttp.WSMsgType.TEXT:
            data = json.loads(message.data)
            match data["type"]:
                case "description":
                    self.description = data
                case "state":
                    self.state = data
                case "events":
                    self.events += data["events"]
        elif message.type is aiohttp.WSMsgType.BINARY:
            described = self.description
            width = len(HEADER) + len(described["groups"]) + 5 * len(described["axes"])
            self.samples += [*np.frombuffer(message.data).reshape(-1, width)]
        return message

    async def until(self, condition: Callable[[], Any]) -> None:
        """Receive until ``condition`` holds."""
        async with asyncio.timeout(TIMEOUT_S):
            while not condition():
                message = await self.receive()
                assert message.type in (aiohttp.WSMsgType.TEXT, aiohttp.WSMsgType.BINARY), message


@asynccontextmanager
async def connected(url: str) -> AsyncIterator[Viewer]:
    """A viewer that has received the first messages."""
    async with aiohttp.ClientSession() as session, session.ws_connect(f"{url}ws") as socket:
        viewer = Viewer(socket)
        await viewer.until(lambda: viewer.events)
        yield viewer


@contextmanager
def silent_viewer(url: str) -> Iterator[None]:
    """A viewer that never reads."""
    address = urlsplit(url)
    with socket.create_connection((address.hostname, address.port)) as silent:
        key = "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n"
        head = f"GET /ws HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\n{key}"
        silent.sendall(f"{head}Connection: Upgrade\r\n\r\n".encode())
        yield
