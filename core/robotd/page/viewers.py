"""Viewers of a page: WebSocket connections with bounded queues."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable
from contextlib import suppress

from aiohttp import WSCloseCode, WSMsgType, web

from robotd.log import get_logger
from robotd.page.page_message import Message

log = get_logger("page")

MAX_QUEUED = 90  # messages: three seconds
SEND_BUFFER_BYTES = 65536  # of the socket, beyond aiohttp's own of the same size


class Viewer:
    """One connection: sends the messages of its queue, in the server's thread.

    Args:
        socket: prepared.
        transport: of the connection.
        messages: first ones to send.
        yield_to_control_loop: called before each message.
    """

    def __init__(
        self,
        socket: web.WebSocketResponse,
        transport: asyncio.Transport,
        messages: list[Message],
        yield_to_control_loop: Callable[[], None],
    ) -> None:
        self._socket, self._transport = socket, transport
        self._yield_to_control_loop = yield_to_control_loop
        self._queue: asyncio.Queue[Message] = asyncio.Queue(MAX_QUEUED)
        self.put(messages)

    def put(self, messages: Iterable[Message]) -> None:
        """Queue messages; drop the viewer where there is no room: it does not read."""
        for message in messages:
            try:
                self._queue.put_nowait(message)
            except asyncio.QueueFull:
                self.drop()
                return

    def drop(self) -> None:
        """Close the connection at once."""
        if not self._transport.is_closing():
            log.warning("viewer dropped: it does not read", waiting=self._queue.qsize())
            self._transport.abort()

    async def run(self, receive: Callable[[str], None] | None = None) -> None:
        """Send until the connection ends.

        Args:
            receive: called with each text that arrives; None: it closes the connection.
        """
        sending = asyncio.create_task(self._send())
        try:
            async for message in self._socket:
                if receive is None or message.type is not WSMsgType.TEXT:
                    reason = b"read-only" if receive is None else b"text is expected"
                    await self._socket.close(code=WSCloseCode.POLICY_VIOLATION, message=reason)
                else:
                    self._yield_to_control_loop()
                    receive(message.data)
        finally:
            sending.cancel()
            with suppress(asyncio.CancelledError, ConnectionError):
                await sending

    async def close(self) -> None:
        """Say that the server goes away."""
        await self._socket.close(code=WSCloseCode.GOING_AWAY, message=b"robotd has ended")

    async def _send(self) -> None:
        while True:
            message = await self._queue.get()
            self._yield_to_control_loop()
            if isinstance(message, bytes):
                await self._socket.send_bytes(message)
            else:
                await self._socket.send_str(message)
