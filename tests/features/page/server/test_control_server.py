"""Access to the control side: nothing is commanded without the token of this start."""

from __future__ import annotations

import asyncio
import itertools
import json
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from http.client import HTTPConnection
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import aiohttp
import pytest
from tests.features.harness import Observed
from tests.features.page.server.viewer import TIMEOUT_S, connected, served_page, wait_until

from robotd.clock import NANOSECONDS
from robotd.robot import Robot
from robotd_page.control_server import MAX_CONTROLLERS
from robotd_page.page_server import PageServer
from robotd_page.viewers import MAX_MESSAGE_BYTES


class Controller:
    """WebSocket client of the control side."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self.socket = socket
        self.welcome: dict[str, Any] = {}
        self.seen: dict[str, Any] | None = None
        self._id = 0

    def see(self, robot: Robot) -> None:
        """Take the present state of the robot for the one that the commands are given for."""
        time_s = robot.clock.now_ns() / NANOSECONDS
        self.seen = {"events": robot.events.added, "time_s": time_s}

    async def send(self, **message: Any) -> None:
        await self.socket.send_str(json.dumps(message))

    async def receive(self) -> dict[str, Any]:
        message = await self.socket.receive(TIMEOUT_S)
        assert message.type is aiohttp.WSMsgType.TEXT, message
        return json.loads(message.data)  # type: ignore[no-any-return]

    async def command(self, type_: str, **fields: Any) -> dict[str, Any]:
        """Send a command and return its answer."""
        self._id += 1
        await self.send(id=self._id, type=type_, seen=self.seen, **fields)
        while (answer := await self.receive())["type"] != "answer" or answer["id"] != self._id:
            pass
        return answer

    async def close_reason(self) -> tuple[int, str | None]:
        while (message := await self.socket.receive(TIMEOUT_S)).type is aiohttp.WSMsgType.TEXT:
            pass
        assert message.type is aiohttp.WSMsgType.CLOSE, message
        return message.data, message.extra


@asynccontextmanager
async def unknown(server: PageServer, **headers: str) -> AsyncIterator[Controller]:
    """A client that has sent nothing yet."""
    async with (
        aiohttp.ClientSession(headers=headers) as session,
        session.ws_connect(f"{server.url}control") as socket,
    ):
        yield Controller(socket)


@asynccontextmanager
async def controller(server: PageServer) -> AsyncIterator[Controller]:
    """A client that has sent the token."""
    async with unknown(server) as client:
        await client.send(token=server._control.token)  # type: ignore[union-attr]
        client.welcome = await client.receive()
        yield client


def run(folder: Path, use: Callable[[Observed, PageServer], Any], **options: Any) -> None:
    with served_page(folder, **({"has_control": True} | options)) as (arm, server):
        asyncio.run(use(arm, server))


def position_is_unchanged(arm: Observed) -> bool:
    arm.step(0.3)
    return bool((abs(arm.robot.image.position) < 1e-6).all())


def test_a_page_without_control_takes_no_commands(tmp_path: Path) -> None:
    async def use(arm: Observed, server: PageServer) -> None:
        with pytest.raises(aiohttp.WSServerHandshakeError, match="404"):
            async with unknown(server):
                pass
        async with connected(server.url) as viewer:
            assert viewer.description["has_control"] is False

    run(tmp_path, use, has_control=False)


FIRST = [
    '{"token": "wrong"}',
    '{"token": ""}',
    '{"token": "wröng"}',
    '{"token": null}',
    '{"id": 1, "type": "stop"}',
    '{"type": "jog", "hold": 1, "joint": "joint1", "velocity": 0.1}',
    "not json",
    "[]",
]


def test_whatever_comes_before_the_token_closes_the_connection(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def use(arm: Observed, server: PageServer) -> None:
        for first in FIRST:
            async with unknown(server) as client:
                await client.socket.send_str(first)
                await client.send(id=2, type="stop")
                assert await client.close_reason() == (1008, "wrong token"), first
        assert arm.robot.axes.stop_latch.reason == ""
        assert position_is_unchanged(arm)

    monkeypatch.setattr("robotd_page.control_server.WRONG_TOKEN_DELAY_S", 0.01)
    run(tmp_path, use)


def test_a_client_that_sends_no_token_is_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def use(arm: Observed, server: PageServer) -> None:
        async with unknown(server) as client:
            assert await client.close_reason() == (1008, "no token")

    monkeypatch.setattr("robotd_page.control_server.TOKEN_TIMEOUT_S", 0.1)
    run(tmp_path, use)


FOREIGN = [
    {"Origin": "http://evil.example"},
    {"Origin": "null"},
    {"Origin": "http://localhost:1"},
    {"Host": "evil.example"},
]


def test_foreign_pages_cannot_connect_even_with_the_token(tmp_path: Path) -> None:
    async def use(arm: Observed, server: PageServer) -> None:
        for headers in FOREIGN:
            with pytest.raises(aiohttp.WSServerHandshakeError, match="403"):
                async with unknown(server, **headers):
                    pass

    run(tmp_path, use)


def test_plain_requests_change_nothing(tmp_path: Path) -> None:
    with served_page(tmp_path, has_control=True) as (arm, server):
        token = server._control.token  # type: ignore[union-attr]
        body = json.dumps({"token": token, "id": 1, "type": "stop"})
        paths = ("control", "stop", "command", f"control?token={token}&type=stop")
        for method, path in itertools.product(("GET", "POST", "PUT"), paths):
            connection = HTTPConnection(urlsplit(server.url).netloc, timeout=TIMEOUT_S)
            connection.request(method, f"/{path}", body, {"Authorization": f"Bearer {token}"})
            assert connection.getresponse().status in (404, 405, 426), (method, path)
            connection.close()
        assert arm.robot.axes.stop_latch.reason == ""


def test_the_token_is_long_new_each_time_and_in_the_fragment_only(tmp_path: Path) -> None:
    with served_page(tmp_path, has_control=True) as (_, server):
        control = server._control
        assert control is not None
        address = urlsplit(control.address(server.url))
        assert (address.query, address.fragment) == ("", f"token={control.token}")
        assert control.token not in server.url
        assert len(control.token) >= 32
    with served_page(tmp_path, has_control=True) as (_, other):
        assert other._control is not None
        assert other._control.token != control.token


def test_a_client_with_the_token_commands_and_gets_the_reason_of_a_rejection(
    tmp_path: Path,
) -> None:
    async def use(arm: Observed, server: PageServer) -> None:
        async with connected(server.url) as viewer:
            assert viewer.description["has_control"] is True
        async with controller(server) as client:
            assert client.welcome["name"] == "page 1"
            assert [*client.welcome["jog_velocities"]] == [*arm.robot.joint_names]
            client.see(arm.robot)
            assert client.welcome["gripper"] is True
            assert "amp_alarm" in client.welcome["faults"]
            answer = await client.command("gripper", closed=True)
            assert (answer["ok"], answer["text"]) == (True, "gripper closes")
            answer = await client.command("output", name="lamp", value=True)
            assert (answer["ok"], answer["text"][:22]) == (False, "unknown output 'lamp' ")
            answer = await client.command("speed", speed=1.5)
            assert (answer["ok"], answer["text"]) == (False, "speed 1.5 is neither 0 nor 0.01 to 1")
            answer = await client.command("inject", fault={"amp_alarm": {"axis": 99}})
            assert (answer["ok"], answer["text"]) == (False, "axis 99 is outside 0..5")
            answer = await client.command("stop")
            assert (answer["ok"], answer["text"]) == (True, "stopped, at rest")
            answer = await client.command("reset")
            assert answer["text"].startswith("motion is allowed again")
        events, _ = arm.robot.events.since(0)
        assert "page 1" in {event.sender for event in events if event.subject == "set_output_bit"}

    run(tmp_path, use)


WRONG = [
    "not json",
    '{"type": "fly"}',
    '{"type": "jog", "hold": 0, "joint": "joint1", "velocity": 0.1}',
    '{"type": "jog", "hold": 1, "joint": "joint1", "velocity": 1e999}',
    '{"type": "release", "hold": 1, "reason": "anything"}',
    '{"id": 1, "type": "servos", "on": "yes"}',
]


def test_wrong_messages_are_answered_and_change_nothing(tmp_path: Path) -> None:
    async def use(arm: Observed, server: PageServer) -> None:
        async with controller(server) as client:
            for text in WRONG:
                await client.socket.send_str(text)
                assert (await client.receive())["type"] == "error", text
            client.see(arm.robot)
            assert (await client.command("speed", speed=1))["ok"]  # it goes on
        assert position_is_unchanged(arm)

    run(tmp_path, use)


def test_messages_and_controllers_are_bounded(tmp_path: Path) -> None:
    async def use(arm: Observed, server: PageServer) -> None:
        async with controller(server) as client:
            await client.socket.send_str("x" * (MAX_MESSAGE_BYTES + 1))
            assert (await client.close_reason())[0] == 1009
        clients = [controller(server) for _ in range(MAX_CONTROLLERS)]
        for operator in clients:
            await operator.__aenter__()
        async with unknown(server) as client:
            await client.send(token=server._control.token)  # type: ignore[union-attr]
            text = f"{MAX_CONTROLLERS} pages control the robot already"
            assert await client.close_reason() == (1013, text)
        for operator in clients:
            await operator.__aexit__(None, None, None)

    run(tmp_path, use)


def test_stop_is_executed_however_many_commands_wait(tmp_path: Path) -> None:
    async def use(arm: Observed, server: PageServer) -> None:
        async with controller(server) as client:
            with arm.robot.connection._lock:  # recovery waits for it
                for number in range(6):
                    await client.send(id=number, type="recover")
                await client.send(id=99, type="stop")
                await asyncio.to_thread(wait_until, lambda: arm.robot.axes.stop_latch.reason)

    run(tmp_path, use)
