"""EtherCAT diagnostics from the engine's master."""

from __future__ import annotations

from robotd.api import BusNode, BusState, BusStatus, FieldbusDriver, OperationError
from robotd_wmx._native import Master, Slave
from robotd_wmx.al_status import text_of_al
from robotd_wmx.connection import WmxConnection
from robotd_wmx.errors import translated

NO_ANSWER = "it does not answer"
ESC_REGISTER_BYTES = 0x1000  # of a slave controller; process data RAM follows

_STATES = {
    0: BusState.UNKNOWN,
    1: BusState.INITIALISING,  # Init
    2: BusState.CONFIGURABLE,  # Preop
    4: BusState.UPDATING,  # Boot
    8: BusState.INPUTS_ONLY,  # Safeop
    16: BusState.OPERATIONAL,  # Op
}
"""States in the numbers of the service. The SDK's differ; the binding maps them by name."""

_MASTER_EXTRA = (
    "mode", "rings", "rx_pdo_size", "tx_pdo_size", "tx_delay", "min_tx_delay", "max_tx_delay",
)  # fmt: skip
_SLAVE_EXTRA = ("inaccessible", "new", "reverse", "alias", "input_address", "output_address")


class WmxFieldbus(FieldbusDriver):
    """The masters of the engine; a call may take as long as the network does."""

    def __init__(self, connection: WmxConnection) -> None:
        self._connection = connection

    @property
    def buses(self) -> int:
        return self._connection.options.masters

    @property
    def register_bytes(self) -> int:
        return ESC_REGISTER_BYTES

    def status(self, bus: int) -> BusStatus:
        """All zeros, with a note, while no device is open."""
        if not self._connection.is_open:
            return BusStatus(BusState.UNKNOWN, note="no device of the WMX engine is open")
        with translated(f"master {bus}"):
            info = Master(self._connection.diagnostics, bus)
        return BusStatus(
            state=_STATES.get(info.state, BusState.UNKNOWN),
            period_s=info.comm_period * 1e-6,
            axes=info.total_axes,
            input_size=info.input_size,
            output_size=info.output_size,
            lost_frames=info.packet_loss,
            timeouts=info.packet_timeout,
            late_cycles=info.over_cycle,
            nodes=tuple(_node(slave) for slave in info.slaves),
            details=_details(info),
            extra={name: getattr(info, name) for name in _MASTER_EXTRA},
        )

    def read_register(self, bus: int, node: int, address: int, length: int) -> bytes:
        with translated(f"master {bus} slave {node} register {address:#06x}"):
            return self._connection.diagnostics.register_read(bus, node, address, length)

    def read_object(self, bus: int, node: int, index: int, subindex: int) -> bytes:
        what = f"master {bus} slave {node}: reading {index:#06x}:{subindex:02X}"
        with translated(what):
            data, abort = self._connection.diagnostics.sdo_upload(bus, node, index, subindex)
        _check_abort(what, abort)
        return data

    def write_object(self, bus: int, node: int, index: int, subindex: int, data: bytes) -> None:
        what = f"master {bus} slave {node}: writing {index:#06x}:{subindex:02X}"
        with translated(what):
            abort = self._connection.diagnostics.sdo_download(bus, node, index, subindex, data)
        _check_abort(what, abort)

    def reset_statistics(self, bus: int) -> None:
        with translated(f"master {bus}: statistics"):
            self._connection.diagnostics.reset_transmit_statistics(bus)
            self._connection.diagnostics.reset_reference_clock(bus)

    def start_hot_connect(self, bus: int) -> None:
        """Returns when it has begun; ``details`` of the network state report its progress."""
        with translated(f"master {bus}: hot connect"):
            self._connection.diagnostics.start_hot_connect(bus)


def _check_abort(what: str, abort: int) -> None:
    """Raise OperationError for an abort code of CiA 301; 0 is none."""
    if abort:
        error = OperationError(f"{what}: the slave aborts with 0x{abort:08X}")
        error.code = abort
        raise error


def _details(info: Master) -> dict[str, str]:
    """Return further counters of the master; the SDK states no units."""
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


def _node(slave: Slave) -> BusNode:
    return BusNode(
        id=slave.id,
        state=BusState.UNKNOWN if slave.offline else _STATES.get(slave.state, BusState.UNKNOWN),
        error_code=slave.al_code,
        position=slave.position,
        address=slave.address,
        offline=bool(slave.offline),
        vendor_id=slave.vendor_id,
        product_code=slave.product_code,
        revision=slave.revision,
        serial=slave.serial,
        input_size=slave.input_size,
        output_size=slave.output_size,
        axes=slave.axes,
        fault=text_of_al(slave.al_code) or (NO_ANSWER if slave.offline else ""),
        extra={name: int(getattr(slave, name)) for name in _SLAVE_EXTRA},
    )
