"""Limits of the page's connections: their number, and the time to the first request."""

from __future__ import annotations

import asyncio

from aiohttp import web
from aiohttp.typedefs import Handler

COUNT_DELAY_S = 0.01


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
