"""Fieldbus diagnostics, and objects of the nodes, with every argument checked."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

from robotd.device.bus_status import BusStatus
from robotd.device.capabilities import Capability
from robotd.device.connection import Connection
from robotd.device.drivers import FieldbusDriver
from robotd.errors import InvalidArgument, Unsupported
from robotd.events import EventLog, logged_command

MAX_OBJECT_BYTES = 4096  # of one write; the longest texts and tables of drives have less


class Fieldbus:
    """Diagnostics of the fieldbuses and their nodes; worker threads only.

    Args:
        driver: the backend's driver; None answers every call with ``Unsupported``.
        events: where writes are recorded; None: in a log of its own.
        kept_at_rest: lets no motion start in its block; raises NotReady while an axis moves.
            None: motion does not matter.
    """

    def __init__(
        self,
        driver: FieldbusDriver | None,
        connection: Connection,
        capabilities: frozenset[Capability],
        backend: str,
        events: EventLog | None = None,
        kept_at_rest: Callable[[str], AbstractContextManager[None]] | None = None,
    ) -> None:
        self.events = events or EventLog(time.monotonic_ns)
        self._kept_at_rest = kept_at_rest or nullcontext
        self._maybe_driver = driver
        self._connection = connection
        self._capabilities = capabilities
        self._backend = backend
        self._newest: dict[int, tuple[float, BusStatus]] = {}  # with the time before it was read

    @property
    def buses(self) -> int:
        """Number of fieldbuses, numbered 0 … buses - 1; 0 where the backend has none."""
        return 0 if self._maybe_driver is None else self._maybe_driver.buses

    def status(self, bus: int, max_age_s: float = 0.0) -> BusStatus:
        """Return the status of one bus and its nodes.

        ``max_age_s``: a status that was read within this time, of the computer's clock, will do.
        """
        driver, now_s = self._checked("network state", None, bus), time.monotonic()
        read_s, status = self._newest.get(bus, (-math.inf, None))
        if status is None or now_s - read_s >= max_age_s:
            status = driver.status(bus)
            self._newest[bus] = now_s, status
        return status

    def read_register(self, bus: int, node: int, address: int, length: int) -> bytes:
        """Return raw register memory of a node; the range must lie inside its memory."""
        driver = self._checked("register_read", Capability.REGISTER_READ, bus)
        size = driver.register_bytes
        if not 1 <= length <= size:
            raise InvalidArgument(f"length {length} is outside 1..{size}")
        if address < 0 or address + length > size:
            raise InvalidArgument(
                f"registers {address:#06x}..{address + length - 1:#06x}"
                f" are outside 0x0000..{size - 1:#06x}"
            )
        _check_node(driver, bus, node)
        return driver.read_register(bus, node, address, length)

    def read_object(self, bus: int, node: int, index: int, subindex: int = 0) -> bytes:
        """Return an object of a node, little-endian as on the bus; also in motion.

        Raises:
            InvalidArgument: there is no such node, or a number is out of range.
            OperationError: the node aborts the transfer, with its reason.
            DeviceTimeout: the node does not answer.
        """
        driver = self._checked("read_object", Capability.OBJECTS, bus)
        _check_object(index, subindex)
        _check_node(driver, bus, node)
        return driver.read_object(bus, node, index, subindex)

    @logged_command
    def write_object(self, bus: int, node: int, index: int, subindex: int, data: bytes) -> None:
        """Write an object of a node while every axis is at rest.

        No motion starts meanwhile. The node does what the object means, whatever the limits of the
        descriptor are. Raises the errors of ``read_object``; NotReady while an axis moves or is
        claimed.
        """
        driver = self._checked("write_object", Capability.OBJECTS, bus)
        _check_object(index, subindex)
        if not 1 <= len(data) <= MAX_OBJECT_BYTES:
            raise InvalidArgument(f"{len(data)} bytes of data are outside 1..{MAX_OBJECT_BYTES}")
        _check_node(driver, bus, node)
        with self._kept_at_rest("writing an object"):
            driver.write_object(bus, node, index, subindex, data)

    def reset_statistics(self, bus: int) -> None:
        """Zero the counters of ``status``."""
        self._checked("reset_statistics", Capability.STATISTICS, bus).reset_statistics(bus)

    def start_hot_connect(self, bus: int) -> None:
        """Let newly attached nodes join."""
        self._checked("hot connect", Capability.HOT_CONNECT, bus).start_hot_connect(bus)

    def _checked(self, feature: str, needs: Capability | None, bus: int) -> FieldbusDriver:
        driver = self._maybe_driver
        if driver is None or (needs is not None and needs not in self._capabilities):
            raise Unsupported(feature, self._backend)
        self._connection.require_ready()
        if not 0 <= bus < driver.buses:
            raise InvalidArgument(f"bus {bus} is outside 0..{driver.buses - 1}")
        return driver


def _check_object(index: int, subindex: int) -> None:
    for name, number, last in (("index", index, 0xFFFF), ("subindex", subindex, 0xFF)):
        if not 0 <= number <= last:
            raise InvalidArgument(f"{name} {number} is outside 0..{last:#x}")


def _check_node(driver: FieldbusDriver, bus: int, node: int) -> None:
    known = [*driver.node_ids(bus)]
    if node not in known:
        raise InvalidArgument(f"node {node} is not on bus {bus} (nodes: {known})")


def object_text(data: bytes) -> str:
    """Format data as ``37 02 (0x0237, 567)``, with the text where it is printable."""
    if not data:
        return "(empty)"
    parts = [data.hex(" ")]
    if len(data) in (1, 2, 4, 8):
        number = int.from_bytes(data, "little")
        parts.append(f"(0x{number:0{2 * len(data)}X}, {number})")
    if len(data) > 1 and data.isascii() and (text := data.decode("ascii")).isprintable():
        parts.append(repr(text))
    return " ".join(parts)


def object_bytes(value: int, size: int) -> bytes:
    """Return ``size`` bytes of ``value``, signed or not, little-endian. Raises InvalidArgument."""
    limit = 1 << 8 * size
    if not -limit // 2 <= value < limit:
        raise InvalidArgument(f"value {value} does not fit in {size} byte{'s' * (size != 1)}")
    return (value % limit).to_bytes(size, "little")
