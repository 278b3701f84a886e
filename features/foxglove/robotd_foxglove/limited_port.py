"""Port in front of a server that has no limit for its connections."""

from __future__ import annotations

import asyncio
import socket
import threading
from contextlib import suppress

from robotd.api import get_logger
from robotd_shared.local_http import MAX_CONNECTIONS

log = get_logger("foxglove")

ADDRESS = "127.0.0.1"
BLOCK_BYTES = 65536
FIRST_TIMEOUT_S = 10.0  # from the connection to its first byte
END_TIMEOUT_S = 2.0


class LimitedPort:
    """Passes at most ``MAX_CONNECTIONS`` on to ``target``, a port of this computer.

    A connection beyond them is closed at once, and one that sends nothing after
    ``FIRST_TIMEOUT_S``. Its thread is ``robotd-foxglove-port``.

    Args:
        port: on the loopback interface; 0: any free one.
        target: port of the server.

    Attributes:
        number: of the port.

    Raises OSError: the port cannot be used.
    """

    def __init__(self, port: int, target: int) -> None:
        self._target = target
        self._connections = 0
        self._socket = socket.create_server((ADDRESS, port), backlog=MAX_CONNECTIONS)
        self.number: int = self._socket.getsockname()[1]
        self._loop = asyncio.new_event_loop()
        self._ended = asyncio.Event()
        self._thread = threading.Thread(target=self._run, name="robotd-foxglove-port", daemon=True)

    def start(self) -> None:
        """Accept connections."""
        self._thread.start()

    def stop(self) -> None:
        """Close all connections and the port."""
        self._loop.call_soon_threadsafe(self._ended.set)
        self._thread.join(END_TIMEOUT_S)

    def _run(self) -> None:
        try:
            with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
                runner.run(self._serve())
        except Exception:
            log.exception("the port for Foxglove has ended")

    async def _serve(self) -> None:
        async with await asyncio.start_server(self._connect, sock=self._socket):
            await self._ended.wait()

    async def _connect(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if self._connections >= MAX_CONNECTIONS:
            writer.transport.abort()
            return
        self._connections += 1
        try:
            with suppress(OSError, TimeoutError):
                first = await asyncio.wait_for(reader.read(BLOCK_BYTES), FIRST_TIMEOUT_S)
                if first:
                    await self._pass_on(reader, writer, first)
        finally:
            self._connections -= 1
            writer.transport.abort()

    async def _pass_on(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, first: bytes
    ) -> None:
        """Copy both directions until one ends."""
        there, back = await asyncio.open_connection(ADDRESS, self._target)
        back.write(first)
        copies = [
            asyncio.create_task(_copy(reader, back)),
            asyncio.create_task(_copy(there, writer)),
        ]
        try:
            await asyncio.wait(copies, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for copy in copies:
                copy.cancel()
            back.transport.abort()


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with suppress(OSError):
        while block := await reader.read(BLOCK_BYTES):
            writer.write(block)
            await writer.drain()
