"""HTTP server on the loopback interface, for probes and scrapers: few requests, one thread each."""

from __future__ import annotations

import logging
import sys
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from socketserver import ThreadingMixIn
from typing import TYPE_CHECKING, Any
from wsgiref.simple_server import WSGIRequestHandler, WSGIServer, make_server

from robotd.api import OperationError

if TYPE_CHECKING:
    from wsgiref.types import StartResponse, WSGIApplication, WSGIEnvironment

foreign = logging.getLogger("http")  # limited: see ``robotd.log``

ADDRESS = "127.0.0.1"
REQUEST_TIMEOUT_S = 10.0
MAX_CONNECTIONS = 64  # of each port: page, metrics, Foxglove, health
LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "[::1]"})


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


@contextmanager
def serve_http(answer: WSGIApplication, port: int, option: str) -> Iterator[int]:
    """Serve HTTP on the loopback interface during the block; the value is the port.

    Each request has a thread. One with a foreign Host or Origin header is answered 403.

    Args:
        answer: called in the threads of requests.
        port: 0 takes any free one.
        option: of ``robotd run``, without dashes, for the error and the name of the thread.

    Raises OperationError: the port is in use.
    """

    def checked(environ: WSGIEnvironment, start_response: StartResponse) -> Iterable[bytes]:
        if reason := rejection(environ.get("HTTP_HOST", ""), environ.get("HTTP_ORIGIN")):
            start_response("403 Forbidden", [("Content-Type", "text/plain; charset=utf-8")])
            return [f"robotd: {reason}\n".encode()]
        return answer(environ, start_response)

    try:
        server = make_server(ADDRESS, port, checked, _Server, _RequestHandler)
    except OSError as error:
        raise OperationError(f"--{option} {port}: {error.strerror or error}") from error
    name = f"robotd-{option}"
    thread = threading.Thread(target=server.serve_forever, name=name, daemon=True)
    thread.start()
    try:
        yield server.server_port
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


class _Server(ThreadingMixIn, WSGIServer):
    """Server of at most ``MAX_CONNECTIONS``, each with a thread; closes those beyond."""

    daemon_threads = True
    block_on_close = False  # a client that sends nothing keeps its thread ``REQUEST_TIMEOUT_S``
    request_queue_size = MAX_CONNECTIONS

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._free = threading.Semaphore(MAX_CONNECTIONS)

    def process_request(self, request: Any, client_address: Any) -> None:
        if self._free.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.close_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Log one line instead of a traceback: any client can cause it."""
        foreign.warning("request failed: %r", sys.exception())


class _RequestHandler(WSGIRequestHandler):
    """Handler of one connection, without a line on stderr for each request."""

    timeout = REQUEST_TIMEOUT_S

    def log_message(self, *_: object) -> None:
        """Log nothing."""
