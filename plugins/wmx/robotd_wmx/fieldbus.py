"""EtherCAT diagnostics from the engine's master."""

from __future__ import annotations

from robotd.api import FieldbusDriver, NetworkState, SlaveInfo
from robotd_wmx._native import Master, Slave
from robotd_wmx.al_status import text_of_al
from robotd_wmx.connection import Connection
from robotd_wmx.errors import translated


class WmxFieldbus(FieldbusDriver):
    """The masters of the engine; a call may take as long as the network does."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    @property
    def masters(self) -> int:
        return self._connection.options.masters

    def network_state(self, master: int) -> NetworkState:
        """All zeros, with a note, while no device is open."""
        if not self._connection.is_open:
            return NetworkState(0, note="no device of the WMX engine is open")
        with translated(f"master {master}"):
            info = Master(self._connection.diagnostics, master)
        return NetworkState(
            state=info.state,
            mode=info.mode,
            comm_period_us=info.comm_period,
            total_axes=info.total_axes,
            input_size=info.input_size,
            output_size=info.output_size,
            rings=info.rings,
            rx_pdo_size=info.rx_pdo_size,
            tx_pdo_size=info.tx_pdo_size,
            tx_delay=info.tx_delay,
            min_tx_delay=info.min_tx_delay,
            max_tx_delay=info.max_tx_delay,
            packet_loss=info.packet_loss,
            packet_timeout=info.packet_timeout,
            over_cycle=info.over_cycle,
            slaves=tuple(_slave(slave) for slave in info.slaves),
            details=_details(info),
        )

    def read_register(self, master: int, slave: int, address: int, length: int) -> bytes:
        with translated(f"master {master} slave {slave} register {address:#06x}"):
            return self._connection.diagnostics.register_read(master, slave, address, length)

    def reset_statistics(self, master: int) -> None:
        with translated(f"master {master}: statistics"):
            self._connection.diagnostics.reset_transmit_statistics(master)
            self._connection.diagnostics.reset_reference_clock(master)

    def start_hot_connect(self, master: int) -> None:
        """Returns when it has begun; ``details`` of the network state tell how it goes on."""
        with translated(f"master {master}: hot connect"):
            self._connection.diagnostics.start_hot_connect(master)


def _details(info: Master) -> dict[str, str]:
    """What else the master counts. The SDK states no units: the figures are as it has them."""
    failure = info.hot_connect_failure
    return {
        "hot connect": f"{info.hot_connect}: {failure}" if failure else info.hot_connect,
        "cycles": str(info.cycles),
        "frames in a cycle": str(info.cyclic_frames),
        "reference clock interval (min, average, max)": (
            f"{info.min_clock_interval}, {info.average_clock_interval}, {info.max_clock_interval}"
        ),
        "difference from the next DC clock (min, max)": (
            f"{info.min_clock_difference}, {info.max_clock_difference}"
        ),
    }


def _slave(slave: Slave) -> SlaveInfo:
    return SlaveInfo(
        id=slave.id,
        state=slave.state,
        al_code=slave.al_code,
        position=slave.position,
        address=slave.address,
        offline=bool(slave.offline),
        inaccessible=bool(slave.inaccessible),
        new=bool(slave.new),
        reverse=bool(slave.reverse),
        vendor_id=slave.vendor_id,
        product_code=slave.product_code,
        revision=slave.revision,
        serial=slave.serial,
        alias=slave.alias,
        input_address=slave.input_address,
        input_size=slave.input_size,
        output_address=slave.output_address,
        output_size=slave.output_size,
        axes=slave.axes,
        fault=text_of_al(slave.al_code),
    )
