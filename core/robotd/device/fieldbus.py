"""Fieldbus diagnostics with every argument checked."""

from __future__ import annotations

from robotd.device.bus_status import BusStatus
from robotd.device.capabilities import Capability
from robotd.device.connection import Connection
from robotd.device.drivers import FieldbusDriver
from robotd.errors import InvalidArgument, Unsupported


class Fieldbus:
    """Diagnostics of the fieldbuses and their nodes; worker threads only.

    Args:
        driver: the backend's driver; None answers every call with ``Unsupported``.
        capabilities: of the backend.
    """

    def __init__(
        self,
        driver: FieldbusDriver | None,
        connection: Connection,
        capabilities: frozenset[Capability],
        backend: str,
    ) -> None:
        self._maybe_driver = driver
        self._connection = connection
        self._capabilities = capabilities
        self._backend = backend

    @property
    def buses(self) -> int:
        """Number of fieldbuses, numbered 0 … buses - 1; 0 where the backend has none."""
        return 0 if self._maybe_driver is None else self._maybe_driver.buses

    def status(self, bus: int) -> BusStatus:
        """Return the status of one bus and its nodes."""
        return self._checked("network state", None, bus).status(bus)

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
        known = [one.id for one in driver.status(bus).nodes]
        if node not in known:
            raise InvalidArgument(f"slave {node} is not on master {bus} (slaves: {known})")
        return driver.read_register(bus, node, address, length)

    def reset_statistics(self, bus: int) -> None:
        """Zero the counters of ``status``."""
        self._checked("reset_statistics", Capability.STATISTICS, bus).reset_statistics(bus)

    def start_hot_connect(self, bus: int) -> None:
        """Let newly attached nodes join."""
        self._checked("start_hotconnect", Capability.HOT_CONNECT, bus).start_hot_connect(bus)

    def _checked(self, feature: str, needs: Capability | None, bus: int) -> FieldbusDriver:
        driver = self._maybe_driver
        if driver is None or (needs is not None and needs not in self._capabilities):
            raise Unsupported(feature, self._backend)
        self._connection.require_ready()
        if not 0 <= bus < driver.buses:
            raise InvalidArgument(f"master {bus} is outside 0..{driver.buses - 1}")
        return driver
