"""Viewers of a page: WebSocket connections with bounded memory."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import TYPE_CHECKING

from aiohttp import WSCloseCode, WSMsgType, web

from robotd.api import get_logger
from robotd_page.page_message import websocket_frames

if TYPE_CHECKING:
    from robotd_page.page_feed import PageFeed

log = get_logger("page")

MAX_WAITING_BYTES = 2**20  # of a viewer, besides the first messages: six seconds of 128 axes
MAX_MESSAGE_BYTES = 1024  # from a viewer
SEND_BUFFER_BYTES = 65536  # of the socket, beyond ``MAX_WAITING_BYTES``


async def accept(
    request: web.Request, heartbeat_s: float
) -> tuple[web.WebSocketResponse, asyncio.Transport | None]:
    """Accept a WebSocket; without its transport where the client has gone already.

    Raises HTTPUpgradeRequired, the answer to a request that asks for no WebSocket.
    """
    socket = web.WebSocketResponse(
        heartbeat=heartbeat_s, compress=False, max_msg_size=MAX_MESSAGE_BYTES, timeout=1.0
    )
    if not socket.can_prepare(request):
        raise web.HTTPUpgradeRequired(text="robotd: a WebSocket is served here\n")
    await socket.prepare(request)
    return socket, request.transport


class Viewer:
    """One connection. Thread of the server.

    Frames are written to the transport, ready-made: a queue and a task for each viewer would cost
    the processor more than everything else of a page.

    Args:
        socket: prepared.
        first: frames to send at once.
        yield_to_control_loop: called before each write.
    """

    def __init__(
        self,
        socket: web.WebSocketResponse,
        transport: asyncio.Transport,
        first: bytes,
        yield_to_control_loop: Callable[[], None],
    ) -> None:
        self._socket, self._transport = socket, transport
        self._yield_to_control_loop = yield_to_control_loop
        self._max_waiting = len(first) + MAX_WAITING_BYTES
        self.send(first)

    def send(self, frames: bytes) -> None:
        """Send WebSocket frames; drop the viewer where too much waits: it does not read."""
        if self._socket.closed or self._transport.is_closing():
            return
        waiting = self._transport.get_write_buffer_size()
        if waiting + len(frames) > self._max_waiting:
            log.warning("viewer dropped: it does not read", waiting_bytes=waiting)
            self._transport.abort()
            return
        self._yield_to_control_loop()
        self._transport.write(frames)

    async def run(self, receive: Callable[[str], None] | None = None) -> None:
        """Serve the connection until it ends.

        Args:
            receive: called with each text that arrives; None: it closes the connection.
        """
        async for message in self._socket:
            if receive is None or message.type is not WSMsgType.TEXT:
                reason = b"read-only" if receive is None else b"text is expected"
                await self._socket.close(code=WSCloseCode.POLICY_VIOLATION, message=reason)
            else:
                self._yield_to_control_loop()
                receive(message.data)

    async def close(self) -> None:
        """Say that the server goes away."""
        await self._socket.close(code=WSCloseCode.GOING_AWAY, message=b"robotd has ended")


class Channel:
    """Viewers of the robot: each frame is made once. Thread of the server.

    Attributes:
        viewers: at present.
    """

    def __init__(self, feed: PageFeed) -> None:
        self._feed = feed
        self.viewers: set[Viewer] = set()

    def first(self) -> bytes:
        """Return the first frames to one more viewer."""
        return websocket_frames(self._feed.first(len(self.viewers) + 1))

    def publish(self, *, changes: bool) -> None:
        """Send the newest samples, and the changes where they are due."""
        if frames := websocket_frames(self._feed.messages(len(self.viewers), changes=changes)):
            for viewer in self.viewers:
                viewer.send(frames)
