"""Status of a fieldbus as the EtherCAT numbers of ``wmx/ecat`` responses."""

from __future__ import annotations

from typing import Any

from robotd.device.bus_status import BusState, BusStatus

AL_STATES = {
    BusState.UNKNOWN: 0,  # None
    BusState.INITIALISING: 1,  # Init
    BusState.CONFIGURABLE: 2,  # Preop
    BusState.UPDATING: 4,  # Boot
    BusState.INPUTS_ONLY: 8,  # Safeop
    BusState.OPERATIONAL: 16,  # Op
}
"""Numbers of the vendor's interface; another bus is shown as the nearest state."""

# Response field → attribute or entry of ``extra`` of the bus, and of a node; 0 where not known.
_BUS = {
    "total_axes": "axes",
    "total_input_size": "input_size",
    "total_output_size": "output_size",
    "packet_loss": "lost_frames",
    "packet_timeout": "timeouts",
    "over_cycle": "late_cycles",
    "master_mode": "mode",
    "total_rxpdo_size": "rx_pdo_size",
    "total_txpdo_size": "tx_pdo_size",
    "tx_delay": "tx_delay",
    "min_tx_delay": "min_tx_delay",
    "max_tx_delay": "max_tx_delay",
}
_NODE = {
    "slave_ids": "id",
    "slave_al_codes": "error_code",
    "slave_positions": "position",
    "slave_addresses": "address",
    "slave_offline": "offline",
    "slave_vendor_ids": "vendor_id",
    "slave_product_codes": "product_code",
    "slave_revision_nos": "revision",
    "slave_serial_nos": "serial",
    "slave_input_sizes": "input_size",
    "slave_output_sizes": "output_size",
    "slave_num_of_axes": "axes",
    "slave_aliases": "alias",
    "slave_input_addrs": "input_address",
    "slave_output_addrs": "output_address",
}
_NODE_FLAGS = {
    "slave_inaccessible": "inaccessible",
    "slave_new": "new",
    "slave_reverse": "reverse",
}


def fill_network_state(response: Any, status: BusStatus) -> Any:
    """Fill every field of an EcatGetNetworkState response; the slaves' arrays in parallel."""
    response.master_state = AL_STATES[status.state]
    response.comm_period = round(status.period_s * 1e6)
    response.ring_num = status.extra.get("rings", 1)
    values = {**status.extra, **vars(status)}
    for field, name in _BUS.items():
        setattr(response, field, values.get(name, 0))
    response.slave_states = [AL_STATES[node.state] for node in status.nodes]
    nodes = [{**node.extra, **vars(node)} for node in status.nodes]
    for field, name in _NODE.items():
        setattr(response, field, [node.get(name, 0) for node in nodes])
    for field, name in _NODE_FLAGS.items():
        setattr(response, field, [bool(node.get(name, 0)) for node in nodes])
    response.num_of_slaves = len(nodes)
    response.success = True
    response.message = status.note or f"{len(nodes)} slaves"
    return response
