"""The server for Foxglove, to a client of its protocol."""

from __future__ import annotations

import asyncio
import json
import struct
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
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
from robotd_shared.robot_state import Goals, state_of

pytest.importorskip("foxglove", reason="no foxglove-sdk: pip install 'robotd[foxglove]'")

from robotd_foxglove.foxglove_server import STATE_SCHEMA, FoxgloveServer

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
                    names = {channel["id"]: topic for topic, channel in self.channels.items()}
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


@contextmanager
def observed(folder: Path) -> Iterator[tuple[Observed, FoxgloveServer]]:
    arm = Observed(folder)
    try:
        with FoxgloveServer(arm.tap, 0) as server:
            yield arm, server
    finally:
        arm.close()


def test_foxglove_gets_joints_transforms_events_and_state(tmp_path: Path) -> None:
    async def watch() -> None:
        async with client_of(server.url) as client:
            topics = ("/joint_states", "/tf", "/rosout", "/robotd/state", "/robot_description")
            await client.subscribe(*topics)
            await client.until(lambda: "/robot_description" in client.newest)
            gripper = arm.robot.gripper
            assert gripper is not None
            gripper.command(True)
            with arm.goal([0.4] * 6, 1.0):
                arm.step(1.5)
            expected = [*arm.robot.image.position, *gripper.finger_positions]
            assert abs(expected[-1]) > 0.01
            await client.until(lambda: "/joint_states" in client.newest)
            await client.until(
                lambda: np.allclose(client.read("/joint_states").position, expected, atol=1e-9)
            )
            assert client.read("/joint_states").name == [*arm.robot.joint_names, *gripper.joints]
            assert "<robot" in client.read("/robot_description").data
            await client.until(lambda: b"link6" in client.newest.get("/tf", b""))
            await client.until(
                lambda: json.loads(client.newest.get("/robotd/state", b"{}")).get("ready")
            )
            assert client.channels["/robotd/state"]["schemaName"] == "robotd.State"
            assert json.loads(client.channels["/robotd/state"]["schema"]) == STATE_SCHEMA
            arm.tap.events.add(EventKind.MARK, "test", "hello")
            await client.until(lambda: b"hello" in client.newest.get("/rosout", b""))
            assert client.read("/rosout").msg == "hello"

    with observed(tmp_path) as (arm, server):
        asyncio.run(watch())
        port = int(server.url.rpartition(":")[2])
        with pytest.raises(OperationError, match=f"foxglove {port}: .*choose another port"):
            FoxgloveServer(arm.tap, port)


def test_values_of_a_lost_device_are_not_sent(tmp_path: Path) -> None:
    async def watch() -> None:
        async with client_of(server.url) as client:
            await client.subscribe("/joint_states", "/rosout", "/robotd/state")
            await client.until(lambda: "/robotd/state" in client.newest)
            arm.step()
            await client.until(lambda: "/joint_states" in client.newest)
            arm.robot.fault_injector.drop_communication()
            arm.step()
            assert arm.robot.image.stamp_ns == 0
            arm.tap.events.add(EventKind.MARK, "test", "after")
            await client.until(lambda: b"after" in client.newest.get("/rosout", b""))
            assert np.isfinite(client.read("/joint_states").position).all()

    with observed(tmp_path) as (arm, server):
        asyncio.run(watch())


def test_each_client_gets_the_description(tmp_path: Path) -> None:
    async def watch() -> None:
        async with client_of(server.url) as first, client_of(server.url) as second:
            for client in (first, second):
                await client.subscribe("/robot_description")
                await client.until(lambda client=client: "/robot_description" in client.newest)

    with observed(tmp_path) as (_, server):
        asyncio.run(watch())


JSON_TYPES = {"string": str, "integer": int, "boolean": bool, "array": list, "null": type(None)}


def assert_fits(value: Any, schema: dict[str, Any], where: str = "state") -> None:
    """Check a value by the part of JSON Schema that the server's schema uses."""
    if "oneOf" in schema:
        (schema,) = (
            choice for choice in schema["oneOf"] if (choice["type"] == "null") == (value is None)
        )
    kind = schema["type"]
    if kind == "object":
        assert isinstance(value, dict), where
        if "properties" in schema:
            assert value.keys() == schema["properties"].keys() == set(schema["required"]), where
            for name, part in schema["properties"].items():
                assert_fits(value[name], part, f"{where}.{name}")
    elif kind == "number":
        assert type(value) in (int, float), where
    else:
        assert type(value) is JSON_TYPES[kind], where
        for number, item in enumerate(value if kind == "array" else ()):
            assert_fits(item, schema["items"], f"{where}[{number}]")


def test_the_state_fits_the_schema_that_clients_are_told(tmp_path: Path) -> None:
    arm = Observed(tmp_path)
    goals = Goals(arm.robot)
    try:
        with arm.goal([0.4] * 6, 1.0):
            arm.step(0.5)
            moving = state_of(arm.tap, goals.running(), 0)
        arm.step(1.5)
        arm.robot.axes.stop_latch.engage("test")
        arm.step(0.5)
        stopped = state_of(arm.tap, goals.running(), 0)
    finally:
        arm.close()
    assert moving["goals"] != [None]
    assert moving["buses"]
    assert moving["buses"][0]["nodes"]
    assert stopped["problems"]
    for state in (moving, stopped):
        assert_fits(json.loads(json.dumps(state)), STATE_SCHEMA)
