from __future__ import annotations

import asyncio
import select
import socket
import time
from contextlib import ExitStack
from http.client import HTTPConnection
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import aiohttp
import pytest
from aiohttp import web
from aiohttp.test_utils import TestClient, TestServer
from prometheus_client import generate_latest
from tests.features.page.server.viewer import (
    TIMEOUT_S,
    connected,
    served_page,
    silent_viewer,
    wait_until,
)

from robotd.errors import OperationError
from robotd_metrics.metrics import registry
from robotd_page.page_feed import RobotSource
from robotd_page.page_message import websocket_frames
from robotd_page.page_server import PageServer
from robotd_page.viewers import MAX_WAITING_BYTES
from robotd_page.viewers import Viewer as ServedViewer
from robotd_shared.local_http import rejection

pytestmark = pytest.mark.daily


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    folder = tmp_path / "bundle"
    folder.mkdir()
    (folder / "index.html").write_text("<!doctype html><title>x</title>")
    (folder / "page.js").write_text("// script")
    return folder


def ask(
    server: PageServer, path: str, method: str = "GET", **headers: str
) -> tuple[int, str, dict[str, str]]:
    """Status, text and headers of an answer."""
    connection = HTTPConnection(urlsplit(server.url).netloc, timeout=TIMEOUT_S)
    connection.request(method, path, headers=headers)
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, text, dict(answer.headers)


@pytest.mark.parametrize(
    "host", ["localhost:8080", "127.0.0.1:9", "127.0.0.1", "[::1]:8080", "LOCALHOST"]
)
def test_names_of_this_computer_are_accepted(host: str) -> None:
    assert rejection(host, None) == ""
    assert rejection(host, f"http://{host}") == ""


@pytest.mark.parametrize(
    ("host", "origin"),
    [
        ("evil.example:8080", None),
        ("127.0.0.1.evil.example", None),
        ("192.168.0.7:8080", None),
        ("", None),
        ("localhost:8080", "http://evil.example"),
        ("localhost:8080", "http://localhost:9090"),
        ("localhost:8080", "https://localhost:8080"),
        ("localhost:8080", "null"),
    ],
)
def test_foreign_hosts_and_origins_are_rejected(host: str, origin: str | None) -> None:
    assert "rejected" in rejection(host, origin)


def test_the_page_comes_with_a_strict_policy(tmp_path: Path, bundle: Path) -> None:
    with served_page(tmp_path, bundle=bundle) as (_, server):
        status, text, headers = ask(server, "/")
        assert (status, text) == (200, "<!doctype html><title>x</title>")
        policy = headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
        assert "frame-ancestors 'none'" in policy
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert ask(server, "/page.js")[0] == 200
        for path in ("/secret", "/../pyproject.toml", "/bundle/page.js", "/mesh/0.stl"):
            assert ask(server, path)[0] == 404, path


def test_foreign_requests_and_other_methods_are_rejected(tmp_path: Path, bundle: Path) -> None:
    with served_page(tmp_path, bundle=bundle) as (_, server):
        status, text, _ = ask(server, "/", Host="evil.example")
        assert status == 403
        assert "evil.example" in text
        assert ask(server, "/ws", Origin="http://evil.example")[0] == 403
        assert ask(server, "/ws")[0] == 426
        for method in ("POST", "PUT", "DELETE", "OPTIONS"):
            assert ask(server, "/", method)[0] == 405


def test_a_page_that_is_not_built_says_how_to_get_it(tmp_path: Path) -> None:
    with served_page(tmp_path, bundle=tmp_path / "none") as (_, server):
        assert not server.is_built
        status, text, _ = ask(server, "/")
        assert status == 503
        assert "make page" in text


def test_metrics_are_on_the_port_of_the_page(tmp_path: Path) -> None:
    with served_page(tmp_path) as (arm, server):
        assert ask(server, "/metrics")[0] == 503
        made = registry(arm.tap, arm.flight)
        with PageServer(RobotSource(arm.tap, []), 0, lambda: generate_latest(made)) as other:
            status, text, _ = ask(other, "/metrics")
    assert status == 200
    assert "robotd_ready 1.0" in text


def test_a_port_in_use_is_an_error(tmp_path: Path) -> None:
    with served_page(tmp_path) as (arm, server):
        port = urlsplit(server.url).port
        assert port is not None
        with pytest.raises(OperationError, match=f"page {port}: Address already in use"):
            PageServer(RobotSource(arm.tap, []), port)


def test_a_viewer_gets_the_description_the_past_and_what_changes(tmp_path: Path) -> None:
    async def watch() -> None:
        async with connected(server.url) as viewer:
            description = viewer.description
            assert description["robot"] == "cr3a"
            assert description["simulated"] is True
            assert description["nodes"] == ["first_node", "second_node"]
            assert "<robot" in description["urdf"]
            assert description["axes"][2]["upper"] == 2.86
            assert len(viewer.samples) > 1  # the past
            assert viewer.state["problems"] == []
            assert viewer.state["viewers"] == 1
            with arm.goal([0.3] * 6, 1.0):
                arm.step(0.5)
                await viewer.until(lambda: any(viewer.state["goals"]))
                assert viewer.state["goals"][0]["duration_s"] == pytest.approx(1.0)
                await viewer.until(lambda: viewer.samples[-1][6] == pytest.approx(0.5, abs=0.05))
            arm.robot.fault_injector.trip(2, 0x8611)
            arm.step(0.2)
            await viewer.until(lambda: viewer.state["problems"])
            (first, *_) = viewer.state["problems"]
            assert first["text"] == "joint3: amplifier alarm 34321 (following error)"
            assert first["is_fault"]
            assert first["remedy"].startswith("Look for a blocked axis")  # as `robotd explain` says
            assert "robotd recover" in first["remedy"]
            assert "following error" in viewer.state["axes"][2]["fault"]
            await viewer.until(lambda: any(event["kind"] == "fault" for event in viewer.events))
            for _ in range(3):  # the same again, so that the page knows that it is not old
                before = viewer.state
                await viewer.until(lambda before=before: viewer.state is not before)
            assert viewer.state == before

    with served_page(tmp_path) as (arm, server):
        asyncio.run(watch())


def test_nothing_is_computed_while_nobody_watches(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def watch() -> None:
        async with connected(server.url):
            await asyncio.to_thread(wait_until, lambda: len(calls) > 5)

    with served_page(tmp_path) as (_, server):
        calls: list[float] = []
        feed: Any = server._source.feed
        live = feed._live
        sample = live.sample
        monkeypatch.setattr(live, "sample", lambda: calls.append(time.monotonic()) or sample())
        asyncio.run(watch())
        wait_until(lambda: not server._channel.viewers and not server._watched.is_set())
        before = len(calls)
        time.sleep(0.3)
        assert len(calls) == before


def test_five_viewers_get_the_same_and_a_ninth_is_told_why_not(tmp_path: Path) -> None:
    async def watch() -> None:
        async with (
            connected(server.url) as first,
            connected(server.url) as second,
            connected(server.url) as third,
            connected(server.url) as fourth,
            connected(server.url) as fifth,
        ):
            viewers = (first, second, third, fourth, fifth)
            arm.step(0.1)
            newest = arm.robot.image.position[0]
            for viewer in viewers:
                await viewer.until(lambda client=viewer: client.state["viewers"] == 5)
                await viewer.until(lambda client=viewer: client.samples[-1][7 + 12] == newest)
            async with aiohttp.ClientSession() as session:
                sixth = await session.ws_connect(f"{server.url}ws")
                message = await sixth.receive(TIMEOUT_S)
                assert message.type is aiohttp.WSMsgType.CLOSE
                assert (message.data, message.extra) == (1013, "5 viewers are connected already")

    with served_page(tmp_path, max_viewers=5) as (arm, server):
        asyncio.run(watch())


def test_a_viewer_that_stops_reading_is_dropped_and_others_are_not(tmp_path: Path) -> None:
    async def watch() -> None:
        async with connected(server.url) as viewer:
            with silent_viewer(server.url):
                await viewer.until(lambda: viewer.state["viewers"] == 2)
                await viewer.until(lambda: viewer.state["viewers"] == 1)

    with served_page(tmp_path, heartbeat_s=0.5) as (_, server):
        asyncio.run(watch())


class Transport:
    """Stand-in of a connection that takes nothing, and of its WebSocket."""

    def __init__(self) -> None:
        self.closed = False
        self.waiting = bytearray()

    def is_closing(self) -> bool:
        return self.closed

    def abort(self) -> None:
        self.closed = True

    def get_write_buffer_size(self) -> int:
        return len(self.waiting)

    def write(self, data: bytes) -> None:
        self.waiting += data


def test_what_waits_for_a_viewer_is_bounded() -> None:
    transport = Transport()
    viewer = ServedViewer(transport, transport, b"first", lambda: None)  # type: ignore[arg-type]
    viewer.send(b"s" * MAX_WAITING_BYTES)
    assert not transport.closed
    viewer.send(b"s")
    assert transport.closed
    viewer.send(b"s")  # without effect
    assert len(transport.waiting) == 5 + MAX_WAITING_BYTES


@pytest.mark.parametrize("size", [0, 125, 126, 65535, 65536, 200_000])
def test_frames_are_read_by_a_client_of_websockets(size: int) -> None:
    messages = [b"x" * size, "ä" * (size // 2)]

    async def answer(request: web.Request) -> web.WebSocketResponse:
        response = web.WebSocketResponse()
        await response.prepare(request)
        assert request.transport is not None
        request.transport.write(websocket_frames(messages))
        await response.receive()
        return response

    async def watch() -> None:
        application = web.Application()
        application.router.add_get("/ws", answer)
        async with TestClient(TestServer(application)) as client:
            viewer = await client.ws_connect("/ws")
            assert await viewer.receive_bytes(timeout=TIMEOUT_S) == messages[0]
            assert await viewer.receive_str(timeout=TIMEOUT_S) == messages[1]

    asyncio.run(watch())


def test_a_viewer_that_sends_something_is_closed(tmp_path: Path) -> None:
    async def watch() -> None:
        async with connected(server.url) as viewer:
            await viewer.socket.send_str("move")
            while (message := await viewer.receive()).type is not aiohttp.WSMsgType.CLOSE:
                pass
            assert (message.data, message.extra) == (1008, "read-only")

    with served_page(tmp_path) as (_, server):
        asyncio.run(watch())


def test_viewers_are_told_that_the_server_ends(tmp_path: Path) -> None:
    async def watch() -> None:
        async with connected(server.url) as viewer:
            ending = asyncio.to_thread(server.__exit__)
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(ending)
                while (message := await viewer.receive()).type is not aiohttp.WSMsgType.CLOSE:
                    pass
            assert message.data == 1001

    with served_page(tmp_path) as (_, server):
        asyncio.run(watch())


def test_connections_that_ask_nothing_are_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("robotd_page.page_server.REQUEST_TIMEOUT_S", 0.2)
    with served_page(tmp_path) as (_, server):
        address = urlsplit(server.url)
        with socket.create_connection((address.hostname, address.port), TIMEOUT_S) as slow:
            slow.sendall(b"GET / HTTP/1.1\r\n")
            assert slow.recv(1) == b""
        assert ask(server, "/metrics")[0] == 503  # it goes on


def test_the_number_of_connections_is_bounded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("robotd_page.page_server.MAX_CONNECTIONS", 4)
    monkeypatch.setattr("robotd_page.page_server.REQUEST_TIMEOUT_S", 1000)
    with served_page(tmp_path) as (_, server), ExitStack() as stack:
        address = urlsplit(server.url)
        opened = [
            stack.enter_context(
                socket.create_connection((address.hostname, address.port), TIMEOUT_S)
            )
            for _ in range(5)
        ]
        closed, _, _ = select.select(opened, [], [], TIMEOUT_S)
        assert closed[0].recv(1) == b""
