"""Every field of the network state that ROS clients of the vendor's driver know."""

from __future__ import annotations

from wmx_ros2_message.srv import EcatGetNetworkState

from robotd.device.bus_status import BusNode, BusState, BusStatus
from robotd_ros.nodes.wmx_ethercat_node import AL_STATES, fill_network_state

FLAGS = dict.fromkeys(("inaccessible", "new", "reverse"), 1)
OTHERS = {"alias": 7, "input_address": 8, "output_address": 9}
BUS = ("mode", "rings", "rx_pdo_size", "tx_pdo_size", "tx_delay", "min_tx_delay", "max_tx_delay")


def node(first: int) -> BusNode:
    numbers = range(first, first + 9)
    keys = ("error_code", "position", "address", "vendor_id", "product_code", "revision", "serial",
            "input_size", "output_size")  # fmt: skip
    values = dict(zip(keys, numbers, strict=True))
    return BusNode(
        first, BusState.OPERATIONAL, offline=True, axes=2, extra=FLAGS | OTHERS,
        **values,
    )  # fmt: skip


def test_network_state_reaches_every_field_of_the_response() -> None:
    status = BusStatus(
        BusState.OPERATIONAL, 0.002, 3, 4, 5, 6, 7, 8, nodes=(node(1), node(20)),
        extra={name: number for number, name in enumerate(BUS, 1)},
    )  # fmt: skip
    response = fill_network_state(EcatGetNetworkState.Response(), status)
    for name in response.get_fields_and_field_types():
        value = getattr(response, name)
        if name.startswith("slave_"):
            assert len(value) == 2, name
            assert all(value), name
        else:
            assert value, name
    assert (response.master_state, response.comm_period, response.over_cycle) == (16, 2000, 8)
    assert (response.master_mode, response.ring_num, response.max_tx_delay) == (1, 2, 7)
    assert list(response.slave_ids) == [1, 20]
    assert list(response.slave_states) == [16, 16]
    assert list(response.slave_output_sizes) == [9, 28]
    assert list(response.slave_num_of_axes) == [2, 2]
    assert response.num_of_slaves == 2


def test_another_bus_leaves_what_only_ethercat_has_at_zero() -> None:
    status = BusStatus(BusState.CONFIGURABLE, nodes=(BusNode(5, BusState.UNKNOWN),), note="a note")
    response = fill_network_state(EcatGetNetworkState.Response(), status)
    assert (response.master_state, list(response.slave_states)) == (2, [0])
    assert (response.master_mode, response.tx_delay, list(response.slave_aliases)) == (0, 0, [0])
    assert response.ring_num == 1
    assert response.message == "a note"


def test_every_state_has_a_number() -> None:
    assert set(AL_STATES) == set(BusState)
