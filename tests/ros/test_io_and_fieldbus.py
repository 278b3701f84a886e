"""wmx/io and wmx/ecat services, good and bad."""

from __future__ import annotations

from typing import Any

import pytest
from tests.ros.robot_process import Client
from wmx_ros2_message.srv import (
    EcatGetNetworkState,
    EcatRegisterRead,
    EcatResetStatistics,
    EcatStartHotconnect,
    GetIoBit,
    GetIoBytes,
    SetIoBit,
    SetIoBytes,
)

pytestmark = [pytest.mark.daily, pytest.mark.ros, pytest.mark.second_backend]


def test_an_output_bit_is_set_and_read_back_without_its_neighbours(client: Client) -> None:
    assert client.call(SetIoBytes, "/wmx/io/set_output_bytes", byte=20, data=b"\x81\x02").success
    assert client.call(SetIoBit, "/wmx/io/set_output_bit", byte=20, bit=3, value=1).success
    response = client.call(GetIoBytes, "/wmx/io/get_output_bytes", byte=20, length=2)
    assert (response.success, bytes(response.data)) == (True, b"\x89\x02")
    assert client.call(GetIoBit, "/wmx/io/get_output_bit", byte=20, bit=3).value == 1
    assert client.call(SetIoBit, "/wmx/io/set_output_bit", byte=20, bit=3, value=0).success
    assert client.call(GetIoBit, "/wmx/io/get_output_bit", byte=20, bit=3).value == 0


def test_inputs(client: Client) -> None:
    response = client.call(GetIoBit, "/wmx/io/get_input_bit", byte=0, bit=0)
    assert (response.success, response.value) == (True, 0)
    response = client.call(GetIoBytes, "/wmx/io/get_input_bytes", byte=0, length=4)
    assert (response.success, bytes(response.data)) == (True, bytes(4))


@pytest.mark.parametrize(
    ("service_type", "name", "request_fields", "reason"),
    [
        (GetIoBit, "get_input_bit", {"byte": 0, "bit": 8}, "bit 8 is outside 0..7"),
        (GetIoBit, "get_output_bit", {"byte": -1, "bit": 0}, "-1"),
        (GetIoBytes, "get_input_bytes", {"byte": 0, "length": 0}, "length 0"),
        (GetIoBytes, "get_output_bytes", {"byte": 7999, "length": 2}, "outside 0..7999"),
        (SetIoBit, "set_output_bit", {"byte": 0, "bit": 1, "value": 2}, "value 2 is not 0 or 1"),
        (SetIoBytes, "set_output_bytes", {"byte": 0, "data": b""}, "length 0"),
    ],
)
def test_bad_io_requests(
    client: Client, service_type: Any, name: str, request_fields: dict[str, Any], reason: str
) -> None:
    response = client.call(service_type, f"/wmx/io/{name}", **request_fields)
    assert not response.success
    assert reason in response.message


def test_network_state_fills_the_slaves_in_parallel(client: Client) -> None:
    state = client.call(EcatGetNetworkState, "/wmx/ecat/get_network_state", master_id=0)
    assert state.success, state.message
    assert state.master_state == 16
    assert state.num_of_slaves == 7
    arrays = [name for name in state.get_fields_and_field_types() if name.startswith("slave_")]
    assert {name: len(getattr(state, name)) for name in arrays} == dict.fromkeys(arrays, 7)
    assert set(state.slave_states) == {16}
    assert sum(state.slave_num_of_axes) == 6


def test_register_read(client: Client) -> None:
    response = client.call(
        EcatRegisterRead,
        "/wmx/ecat/register_read",
        master_id=0,
        slave_id=0,
        reg_address=0x130,
        length=2,
    )
    assert response.success, response.message
    assert bytes(response.data) == b"\x08\x00"  # AL status register: operational


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"master_id": 3}, "bus 3"),
        ({"slave_id": 40}, "node 40"),
        ({"length": 0}, "length 0"),
        ({"reg_address": 0xFFF, "length": 2}, "outside 0x0000..0x0fff"),
    ],
)
def test_bad_register_reads(client: Client, fields: dict[str, int], reason: str) -> None:
    good = {"master_id": 0, "slave_id": 0, "reg_address": 0, "length": 1}
    response = client.call(EcatRegisterRead, "/wmx/ecat/register_read", **(good | fields))
    assert not response.success
    assert reason in response.message


def test_statistics_and_hot_connect(client: Client) -> None:
    for service_type, name in (
        (EcatResetStatistics, "reset_statistics"),
        (EcatStartHotconnect, "start_hotconnect"),
    ):
        assert client.call(service_type, f"/wmx/ecat/{name}", master_id=0).success
        response = client.call(service_type, f"/wmx/ecat/{name}", master_id=5)
        assert not response.success
        assert "bus 5" in response.message
