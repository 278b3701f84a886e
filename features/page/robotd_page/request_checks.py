"""Checks of HTTP requests and headers of responses: only this computer's own pages may ask."""

from __future__ import annotations

from aiohttp import web
from aiohttp.typedefs import Handler

from robotd_shared.local_ports import rejection

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


@web.middleware
async def check_request(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Answer 403 to foreign requests."""
    if reason := rejection(request.headers.get("Host", ""), request.headers.get("Origin")):
        return web.Response(status=403, text=f"robotd: {reason}\n")
    return await handler(request)


async def add_headers(request: web.Request, response: web.StreamResponse) -> None:
    """Add ``HEADERS`` to every response."""
    response.headers.update(HEADERS)
