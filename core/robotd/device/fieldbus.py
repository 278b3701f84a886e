"""Fieldbus diagnostics with every argument checked."""

from __future__ import annotations

from robotd.device.capabilities import Capability
from robotd.device.connection import Connection
from robotd.device.drivers import FieldbusDriver, NetworkState
from robotd.errors import InvalidArgument, Unsupported

REGISTER_SPACE = 0x1000  # ESC registers end at 0x0FFF; process data RAM follows


class Fieldbus:
    """Diagnostics of the masters and slaves; worker threads only.

    Args:
        driver: the backend's driver; None answers every call with ``Unsupported``.
        capabilities: what of it the backend offers.
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
    def masters(self) -> int:
        """Number of masters, ids 0 … masters - 1; 0 where the backend has no fieldbus."""
        return 0 if self._maybe_driver is None else self._maybe_driver.masters

    def network_state(self, master: int) -> NetworkState:
        return self._master("network state", None, master).network_state(master)

    def read_register(self, master: int, slave: int, address: int, length: int) -> bytes:
        """Raw ESC memory: ``address + length`` must stay within 0x1000."""
        driver = self._master("register_read", Capability.REGISTER_READ, master)
        if not 1 <= length <= REGISTER_SPACE:
            raise InvalidArgument(f"length {length} is outside 1..{REGISTER_SPACE}")
        if address < 0 or address + length > REGISTER_SPACE:
            raise InvalidArgument(
                f"registers {address:#06x}..{address + length - 1:#06x}"
                f" are outside 0x0000..{REGISTER_SPACE - 1:#06x}"
            )
        known = [info.id for info in driver.network_state(master).slaves]
        if slave not in known:
            raise InvalidArgument(f"slave {slave} is not on master {master} (slaves: {known})")
        return driver.read_register(master, slave, address, length)

    def reset_statistics(self, master: int) -> None:
        self._master("reset_statistics", Capability.STATISTICS, master).reset_statistics(master)

    def start_hot_connect(self, master: int) -> None:
        self._master("start_hotconnect", Capability.HOT_CONNECT, master).start_hot_connect(master)

    def _master(self, feature: str, needs: Capability | None, master: int) -> FieldbusDriver:
        driver = self._maybe_driver
        if driver is None or (needs is not None and needs not in self._capabilities):
            raise Unsupported(feature, self._backend)
        self._connection.require_ready()
        if not 0 <= master < driver.masters:
            raise InvalidArgument(f"master {master} is outside 0..{driver.masters - 1}")
        return driver
