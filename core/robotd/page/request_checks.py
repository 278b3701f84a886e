"""Checks of HTTP requests and headers of responses: only this computer's own pages may ask."""

from __future__ import annotations

from aiohttp import web
from aiohttp.typedefs import Handler

LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "[::1]"})
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


def rejection(host: str, origin: str | None) -> str:
    """Return why a request is rejected; "" where it is not.

    The Host check stops DNS rebinding: a foreign name that leads to the loopback interface. The
    Origin check stops pages of other servers. The port may differ from the server's own, so that
    a tunnel works.

    Args:
        host: Host header.
        origin: Origin header; None where the client sent none, as programs do.
    """
    name = host.rpartition(":")[0] if host.rpartition(":")[2].isdigit() else host
    if name.lower() not in LOOPBACK_NAMES:
        return f"host {host!r} is rejected: open http://localhost and the port"
    if origin is not None and origin != f"http://{host}":
        return f"origin {origin!r} is rejected: only the page itself may connect"
    return ""


@web.middleware
async def check_request(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Answer 403 to foreign requests."""
    if reason := rejection(request.headers.get("Host", ""), request.headers.get("Origin")):
        return web.Response(status=403, text=f"robotd: {reason}\n")
    return await handler(request)


async def add_headers(request: web.Request, response: web.StreamResponse) -> None:
    """Add ``HEADERS`` to every response."""
    response.headers.update(HEADERS)
