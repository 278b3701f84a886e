"""HTTP server of a command's own page, on the loopback interface: one thread for each request."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from socketserver import ThreadingMixIn
from typing import TYPE_CHECKING
from wsgiref.simple_server import WSGIRequestHandler, WSGIServer, make_server

from robotd.api import OperationError

if TYPE_CHECKING:
    from wsgiref.types import StartResponse, WSGIApplication, WSGIEnvironment

ADDRESS = "127.0.0.1"
REQUEST_TIMEOUT_S = 10.0


@contextmanager
def serve_page(answer: WSGIApplication, port: int) -> Iterator[int]:
    """Serve ``answer`` during the block; the value is the port, of which 0 takes any free one.

    A request with the Host or Origin header of another server is answered 403: DNS rebinding, and
    pages of others. Raises OperationError: the port is in use.
    """

    def checked(environ: WSGIEnvironment, start_response: StartResponse) -> Iterable[bytes]:
        host = environ.get("HTTP_HOST", "")
        own = host in {f"{name}:{server.server_port}" for name in (ADDRESS, "localhost")}
        if own and environ.get("HTTP_ORIGIN") in {None, f"http://{host}"}:
            return answer(environ, start_response)
        start_response("403 Forbidden", [("Content-Type", "text/plain; charset=utf-8")])
        return [b"open the address on the terminal\n"]

    try:
        server = make_server(ADDRESS, port, checked, _Server, _RequestHandler)
    except OSError as error:
        text = f"--page {port}: {error.strerror or error}; choose another port"
        raise OperationError(text) from error
    thread = threading.Thread(target=server.serve_forever, name="robotd-page", daemon=True)
    thread.start()
    try:
        yield server.server_port
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


class _Server(ThreadingMixIn, WSGIServer):
    daemon_threads = True
    block_on_close = False  # a client that sends nothing keeps its thread ``REQUEST_TIMEOUT_S``

    def handle_error(self, request: object, client_address: object) -> None:
        """Ignore a connection that was cut: the page asks again."""


class _RequestHandler(WSGIRequestHandler):
    timeout = REQUEST_TIMEOUT_S

    def log_message(self, *_: object) -> None:
        """Log nothing: the path has the token."""
