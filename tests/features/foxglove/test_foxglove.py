"""The server for Foxglove, to a client of its protocol."""

from __future__ import annotations

import asyncio
import json
import struct
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import aiohttp
import numpy as np
import pytest
from mcap_ros2._dynamic import generate_dynamic
from tests.features.harness import Observed
from tests.features.page.server.viewer import TIMEOUT_S

from robotd.errors import OperationError
from robotd.events import EventKind

pytest.importorskip("foxglove", reason="no foxglove-sdk: pip install 'robotd[foxglove]'")

from robotd_foxglove.foxglove_server import FoxgloveServer

PROTOCOL = "foxglove.sdk.v1"
MESSAGE_DATA = 1  # opcode, then subscription id (uint32), time (uint64), message


class Client:
    """WebSocket client that keeps the newest message of each topic that it subscribes."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._socket = socket
        self.channels: dict[str, dict[str, Any]] = {}
        self.newest: dict[str, bytes] = {}

    async def subscribe(self, *topics: str) -> None:
        """Subscribe topics, with their channel's id as the id of the subscription."""
        await self.until(lambda: all(topic in self.channels for topic in topics))
        ids = [self.channels[topic]["id"] for topic in topics]
        wanted = [{"id": number, "channelId": number} for number in ids]
        await self._socket.send_json({"op": "subscribe", "subscriptions": wanted})

    async def until(self, condition: Any) -> None:
        async with asyncio.timeout(TIMEOUT_S):
            while not condition():
                message = await self._socket.receive()
                if message.type is aiohttp.WSMsgType.TEXT:
                    data = json.loads(message.data)
                    for channel in data.get("channels", ()):
                        self.channels[channel["topic"]] = channel
                elif message.data[0] == MESSAGE_DATA:
                    number, _ = struct.unpack_from("<IQ", message.data, 1)
                    names = {each["id"]: topic for topic, each in self.channels.items()}
                    self.newest[names[number]] = message.data[13:]

    def read(self, topic: str) -> Any:
        """The newest message of a ROS topic, by the schema that the server sent."""
        channel = self.channels[topic]
        readers = generate_dynamic(channel["schemaName"], channel["schema"])
        return readers[channel["schemaName"]](self.newest[topic])


@asynccontextmanager
async def client_of(url: str) -> AsyncIterator[Client]:
    async with (
        aiohttp.ClientSession() as session,
        session.ws_connect(url, protocols=(PROTOCOL,)) as socket,
    ):
        yield Client(socket)


def test_foxglove_gets_joints_transforms_events_and_state(tmp_path: Path) -> None:
    async def watch() -> None:
        async with client_of(server.url) as client:
            topics = ("/joint_states", "/tf", "/rosout", "/robotd/state", "/robot_description")
            await client.subscribe(*topics)
            await client.until(lambda: "/robot_description" in client.newest)
            with arm.goal([0.4] * 6, 1.0):
                arm.step(1.5)
            expected = arm.robot.image.position
            await client.until(lambda: "/joint_states" in client.newest)
            await client.until(
                lambda: np.allclose(client.read("/joint_states").position, expected, atol=1e-9)
            )
            assert client.read("/joint_states").name == [*arm.robot.joint_names]
            assert "<robot" in client.read("/robot_description").data
            await client.until(lambda: b"link6" in client.newest.get("/tf", b""))
            await client.until(
                lambda: json.loads(client.newest.get("/robotd/state", b"{}")).get("ready")
            )
            arm.tap.events.add(EventKind.MARK, "test", "hello")
            await client.until(lambda: b"hello" in client.newest.get("/rosout", b""))
            assert client.read("/rosout").msg == "hello"

    arm = Observed(tmp_path)
    try:
        with FoxgloveServer(arm.tap, 0) as server:
            asyncio.run(watch())
            port = int(server.url.rpartition(":")[2])
            with pytest.raises(OperationError, match=f"foxglove {port}: .*choose another port"):
                FoxgloveServer(arm.tap, port)
    finally:
        arm.close()
