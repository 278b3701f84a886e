"""Guards of the page's server: number of connections, time to a request, and who may ask."""

from __future__ import annotations

import asyncio

from aiohttp import web
from aiohttp.typedefs import Handler

from robotd_shared.local_http import rejection

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
