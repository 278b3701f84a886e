"""HTTP server of the page: bundle, WebSocket, meshes and metrics, on the loopback interface."""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Self

from aiohttp import WSCloseCode, web
from aiohttp.typedefs import Handler

from robotd.api import InvalidArgument, OperationError, RobotdError, get_logger
from robotd_page.control_server import PageControl
from robotd_page.live_samples import RATE_HZ
from robotd_page.viewers import (
    MAX_MESSAGE_BYTES,
    SEND_BUFFER_BYTES,
    Channel,
    Viewer,
    accept,
)
from robotd_shared.local_http import MAX_CONNECTIONS, rejection

if TYPE_CHECKING:
    from robotd_page.page_feed import RobotSource

log = get_logger("page")

ADDRESS = "127.0.0.1"
MAX_VIEWERS = 8
HEARTBEAT_S = 5.0  # a viewer that does not answer within 1.5 of it is dropped
REQUEST_TIMEOUT_S = 10.0
START_TIMEOUT_S = 5.0
END_TIMEOUT_S = 2.0
CHANGES_TICKS = 3  # of ``RATE_HZ``: state and events
BUNDLE_FOLDER = Path(__file__).parent / "bundle"  # built by `make page`
BUNDLE = {
    "/": ("index.html", "text/html"),
    "/page.js": ("page.js", "text/javascript"),
    "/page.css": ("page.css", "text/css"),
    "/favicon.svg": ("favicon.svg", "image/svg+xml"),
    "/licenses.txt": ("LICENSES.txt", "text/plain"),
}
NOT_BUILT = (
    "robotd: the page is not built. In a checkout: make page (it needs Node.js, or installs it"
    " into .venv). The robot is served as ever, and so are /metrics and /ws.\n"
)
COUNT_DELAY_S = 0.01
CONTENT_SECURITY_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:;"
    " connect-src 'self' blob: data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "Content-Security-Policy": CONTENT_SECURITY_POLICY,
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}


class PageServer:
    """Server of a page: ``with PageServer(...):``. Its thread is ``robotd-page``.

    Nothing is computed without viewers. Viewers share each message; one that does not read
    is dropped. Every request only reads, except those of ``control``.

    Args:
        source: robot that is shown.
        port: on the loopback interface; 0: any free one.
        metrics: returns the text of the metrics, None where there are none; None: not served.
        control: takes the commands of pages that have its token; None: the page is read-only.
        max_viewers: number of viewers at a time.
        heartbeat_s: interval of the pings to viewers.
        bundle: folder of the built page.

    Attributes:
        url: of the page.

    Raises OperationError: the port cannot be used.
    """

    def __init__(
        self,
        source: RobotSource,
        port: int,
        metrics: Callable[[], bytes | None] | None = None,
        *,
        control: PageControl | None = None,
        max_viewers: int = MAX_VIEWERS,
        heartbeat_s: float = HEARTBEAT_S,
        bundle: Path = BUNDLE_FOLDER,
    ) -> None:
        self._source = source
        self._channel = Channel(source.feed)
        self._metrics, self._bundle, self._control = metrics, bundle, control
        self._max_viewers, self._heartbeat_s = max_viewers, heartbeat_s
        self._watched = asyncio.Event()
        self._ended = asyncio.Event()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._socket = _bound(port)
        self.url = f"http://{ADDRESS}:{self._socket.getsockname()[1]}/"
        self._listening = threading.Event()
        self._thread = threading.Thread(target=self._run, name="robotd-page", daemon=True)

    @property
    def is_built(self) -> bool:
        """The bundle of the page is there."""
        return (self._bundle / "page.js").is_file()

    def __enter__(self) -> Self:
        self._thread.start()
        self._listening.wait(START_TIMEOUT_S)
        log.info("page", url=self.url)
        if not self.is_built:
            log.warning("the page is not built", advice="make page")
        return self

    def __exit__(self, *_: object) -> None:
        if self._loop is not None:
            with suppress(RuntimeError):  # it has ended by an error
                self._loop.call_soon_threadsafe(self._ended.set)
        self._thread.join(END_TIMEOUT_S)

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
        except Exception:
            log.exception("the page has ended")
        finally:
            self._socket.close()
            self._listening.set()

    async def _serve(self) -> None:
        self._loop = loop = asyncio.get_running_loop()
        guard = ConnectionGuard(MAX_CONNECTIONS, REQUEST_TIMEOUT_S)
        application = web.Application(
            middlewares=[guard.note_request, check_request], client_max_size=MAX_MESSAGE_BYTES
        )
        application.on_response_prepare.append(add_headers)
        for path in BUNDLE:
            application.router.add_get(path, self._answer_bundle)
        application.router.add_get("/ws", self._answer_viewer)
        if self._control:
            application.router.add_get("/control", self._control.answer)
        application.router.add_get("/metrics", self._answer_metrics)
        application.router.add_get("/camera/{name}", self._answer_picture)
        application.router.add_get("/mesh/{path:.+}", self._answer_mesh)
        runner = web.AppRunner(
            application,
            access_log=None,
            keepalive_timeout=REQUEST_TIMEOUT_S,
            shutdown_timeout=END_TIMEOUT_S / 2,
        )
        await runner.setup()
        guard.server = runner.server
        server = await loop.create_server(guard.connection, sock=self._socket)
        publishing = asyncio.create_task(self._publish())
        self._listening.set()
        ended = asyncio.create_task(self._ended.wait())
        await asyncio.wait((publishing, ended), return_when=asyncio.FIRST_COMPLETED)
        publishing.cancel()
        server.close()
        if self._control:
            await self._control.close()
        closings = [viewer.close() for viewer in self._channel.viewers]
        await asyncio.gather(*closings, return_exceptions=True)
        await runner.cleanup()
        with suppress(asyncio.CancelledError):
            await publishing  # raises what has ended it

    async def _publish(self) -> None:
        """Send samples at ``RATE_HZ``, and changes, while there are viewers."""
        clock = asyncio.get_running_loop().time
        due_s, tick = 0.0, 0
        while True:
            if not self._channel.viewers:
                self._watched.clear()
                await self._watched.wait()
            self._source.yield_to_control_loop()
            self._channel.publish(changes=tick % CHANGES_TICKS == 0)
            tick += 1
            now_s = clock()
            due_s = max(due_s + 1.0 / RATE_HZ, now_s)
            await asyncio.sleep(due_s - now_s)

    async def _answer_viewer(self, request: web.Request) -> web.StreamResponse:
        response, transport = await accept(request, self._heartbeat_s)
        if transport is None:
            return response
        if len(self._channel.viewers) >= self._max_viewers:
            text = f"{self._max_viewers} viewers are connected already"
            await response.close(code=WSCloseCode.TRY_AGAIN_LATER, message=text.encode())
            return response
        raw = transport.get_extra_info("socket")
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
        first, wait = self._channel.first(), self._source.yield_to_control_loop
        viewer = Viewer(response, transport, first, wait)
        self._channel.viewers.add(viewer)
        self._watched.set()
        try:
            await viewer.run()
        finally:
            self._channel.viewers.discard(viewer)
        return response

    async def _answer_bundle(self, request: web.Request) -> web.StreamResponse:
        name, content_type = BUNDLE[request.path]
        file = self._bundle / name
        if not file.is_file():
            return web.Response(status=503, text=NOT_BUILT)
        return web.Response(body=file.read_bytes(), content_type=content_type, charset="utf-8")

    async def _answer_metrics(self, request: web.Request) -> web.StreamResponse:
        metrics = self._metrics() if self._metrics else None
        if metrics is None:
            text = "robotd: metrics need prometheus_client: pip install 'robotd[metrics]'\n"
            return web.Response(status=503, text=text)
        content_type = "text/plain; version=0.0.4; charset=utf-8"
        return web.Response(body=metrics, headers={"Content-Type": content_type})

    async def _answer_picture(self, request: web.Request) -> web.StreamResponse:
        """Answer one picture; a page asks for the next one when it has shown it."""
        try:
            picture = await asyncio.to_thread(self._source.picture, request.match_info["name"])
        except InvalidArgument as error:
            return web.Response(status=404, text=f"robotd: {error}\n")
        except RobotdError as error:
            log.warning("no picture", reason=str(error))
            return web.Response(status=503, text=f"robotd: {error}\n")
        return web.Response(body=picture, content_type="image/jpeg")

    async def _answer_mesh(self, request: web.Request) -> web.StreamResponse:
        file = self._source.file(request.path)
        if file is None:
            return web.Response(status=404, text=f"robotd: no mesh {request.path}\n")
        return web.FileResponse(file)


def _bound(port: int) -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        made.bind((ADDRESS, port))
    except OSError as error:
        made.close()
        text = f"page {port}: {error.strerror or error}; choose another port"
        raise OperationError(text) from error
    return made


class ConnectionGuard:
    """Factory of connections that closes those beyond a number, and those that ask nothing.

    Thread of the server.

    Args:
        max_connections: open at a time.
        timeout_s: from the connection to its first complete request.

    Attributes:
        server: of aiohttp, which serves the connections; set before the first.
    """

    def __init__(self, max_connections: int, timeout_s: float) -> None:
        self.server: web.Server | None = None
        self._max_connections, self._timeout_s = max_connections, timeout_s
        self._silent: dict[asyncio.BaseProtocol, asyncio.TimerHandle] = {}

    def connection(self) -> asyncio.BaseProtocol:
        """Return the protocol of a new connection."""
        if self.server is None:
            raise RuntimeError("no server is set")
        protocol: web.RequestHandler = self.server()
        loop = asyncio.get_running_loop()
        # Connections of one burst are counted after they are made.
        loop.call_later(COUNT_DELAY_S, self._count, protocol)
        self._silent[protocol] = loop.call_later(self._timeout_s, self._close, protocol)
        return protocol

    @web.middleware
    async def note_request(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Note that a connection has sent a request; a middleware."""
        if timer := self._silent.pop(request.protocol, None):
            timer.cancel()
        return await handler(request)

    def _count(self, protocol: web.RequestHandler) -> None:
        """Close a connection that is one too many."""
        if self.server and len(self.server.connections) > self._max_connections:
            self._close(protocol)

    def _close(self, protocol: web.RequestHandler) -> None:
        if timer := self._silent.pop(protocol, None):
            timer.cancel()
        if isinstance(protocol.transport, asyncio.Transport):
            protocol.transport.abort()


@web.middleware
async def check_request(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Answer 403 to foreign requests."""
    if reason := rejection(request.headers.get("Host", ""), request.headers.get("Origin")):
        return web.Response(status=403, text=f"robotd: {reason}\n")
    return await handler(request)


async def add_headers(request: web.Request, response: web.StreamResponse) -> None:
    """Add ``HEADERS`` to every response."""
    response.headers.update(HEADERS)
