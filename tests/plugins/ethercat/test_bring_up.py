"""Bring-up: every error names slave, step, and what was found and expected."""

from __future__ import annotations

from typing import Any

import pytest
from tests.plugins.ethercat.harness import Harness

from robotd.errors import ConnectError, InvalidArgument, NotReady, OperationError
from robotd_ethercat.al_status import AlState
from robotd_ethercat.soem import MappingError


def failure(harness: Harness) -> str:
    with pytest.raises(ConnectError) as caught:
        harness.robot.start()
    harness.robot.shutdown()
    return str(caught.value)


def test_a_missing_slave_is_named_with_what_the_bus_has(monkeypatch: pytest.MonkeyPatch) -> None:
    harness = Harness(monkeypatch)
    harness.bus.all[1].present = False
    text = failure(harness)
    assert "eth0 → joint2 (slave 1)" in text
    assert "missing: the bus has 1 slaves, 0 to 0" in text
    assert "check cable and power behind slave 0 (drive0)" in text


def test_an_empty_bus_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    harness = Harness(monkeypatch)
    harness.bus.all[0].present = False
    assert "no EtherCAT slave answers" in failure(harness)


def test_a_wrong_identity_is_named_with_both_values(monkeypatch: pytest.MonkeyPatch) -> None:
    axes = [
        {"axis": 0, "slave": 0, "identity": {"product_code": 0x9999}},
        {"axis": 1, "slave": 1, "identity": {"vendor_id": 0x1234}},
    ]
    text = failure(Harness(monkeypatch, axes=axes))
    assert "identity: product_code is 0x00005678, expected is 0x00009999" in text
    assert "slave 1" not in text


def test_a_wrong_alias_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    axes = [{"axis": 0, "slave": 0, "alias": 7}, {"axis": 1, "slave": 1}]
    assert "alias: the station alias is 0, expected is 7" in failure(
        Harness(monkeypatch, axes=axes)
    )


def test_an_al_status_code_is_given_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    harness = Harness(monkeypatch)
    harness.slave(1).rejects[AlState.SAFE_OP] = 0x001D
    text = failure(harness)
    assert "SafeOp requested, the slave is in PreOp" in text
    assert "AL status 0x001D: invalid output configuration" in text


def test_a_state_that_is_not_reached_has_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    harness = Harness(monkeypatch, state_timeout_s=0.1)
    monkeypatch.setattr(harness.bus, "request", lambda *_, **__: None)
    assert "PreOp requested, the slave is in Init: no error within 0.1 s" in failure(harness)


def test_a_missing_object_names_the_pdo_and_the_key(monkeypatch: pytest.MonkeyPatch) -> None:
    harness = Harness(monkeypatch)
    harness.slave(0).values[0x1A00, 0] = 2
    text = failure(harness)
    assert (
        "mapping: no PDO in 0x1C13 (0x1A00) holds 0x6064 (position actual value); give tx_pdos"
        in text
    )


def test_sizes_that_differ_are_given_both(monkeypatch: pytest.MonkeyPatch) -> None:
    io = [{"slave": 2, "input_length": 4, "output_length": 2}]
    text = failure(Harness(monkeypatch, io=io))
    assert "exchanges 2 bytes of outputs and 2 of inputs, the options give 2 and 4" in text


def test_the_mapping_of_the_options_is_written(monkeypatch: pytest.MonkeyPatch) -> None:
    axis: dict[str, Any] = {
        "axis": 0,
        "slave": 0,
        "rx_pdos": [{"index": 0x1600, "objects": ["0x6040", "0x6060", "0x607A", "0x60FF"]}],
        "tx_pdos": [{"index": 0x1A00, "objects": ["0x6041", "0x6061", "0x6064"]}],
    }
    harness = Harness(monkeypatch, axes=[axis, {"axis": 1, "slave": 1}])
    harness.robot.start()
    values = harness.slave(0).values
    assert values[0x1600, 0] == 4
    assert values[0x1A00, 3] == 0x60640020
    assert harness.slave(0).output_struct.size == 11
    assert harness.image.servo_on.all()
    harness.robot.shutdown()


def test_start_up_objects_and_watchdog_are_written(monkeypatch: pytest.MonkeyPatch) -> None:
    startup = [{"object": "0x6065", "value": 500}, {"object": "0x2000:1", "value": 3}]
    axes = [{"axis": 0, "slave": 0, "startup": startup}, {"axis": 1, "slave": 1}]
    harness = Harness(monkeypatch, axes=axes, watchdog_ms=20.0)
    harness.slave(0).values[0x2000, 1] = 0
    harness.robot.start()
    assert (0x6065, 0, (500).to_bytes(4, "little")) in harness.slave(0).written
    assert harness.slave(0).values[0x2000, 1] == 3
    assert harness.bus.watchdogs == {0: 20.0, 1: 20.0, 2: 20.0}
    harness.robot.shutdown()


def test_sections_of_one_drive_add_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """The second axis gives its PDOs and start-up objects by their own numbers."""

    def pdos(axis: int) -> dict[str, Any]:
        first = 0x800 * axis
        outputs = [f"0x{index + first:04X}" for index in (0x6040, 0x6060, 0x607A, 0x60FF)]
        inputs = [f"0x{index + first:04X}" for index in (0x6041, 0x6061, 0x6064)]
        return {
            "rx_pdos": [{"index": 0x1600 + 16 * axis, "objects": outputs}],
            "tx_pdos": [{"index": 0x1A00 + 16 * axis, "objects": inputs}],
            "startup": [{"object": f"0x{0x6065 + first:04X}", "value": 500 + axis}],
        }

    axes = [
        {"axis": 0, "slave": 0, **pdos(0)},
        {"axis": 1, "slave": 0, "axis_offset": 1, **pdos(1)},
    ]
    harness = Harness(monkeypatch, drives=2, axes=axes, io=[])
    slave = harness.slave(0)
    for index in range(0x6000, 0x6800):  # of the second axis, which no motor belongs to
        if (index, 0) in slave.values:
            slave.values[index + 0x800, 0] = slave.values[index, 0]
    failure(harness)
    assert [slave.values[0x1C12, sub] for sub in (1, 2)] == [0x1600, 0x1610]
    assert [slave.values[0x1C13, sub] for sub in (1, 2)] == [0x1A00, 0x1A10]
    assert slave.values[0x6865, 0] == 501
    assert (0x7065, 0) not in slave.values


def test_a_value_too_large_for_its_object_is_rejected(monkeypatch: pytest.MonkeyPatch) -> None:
    axes = [
        {"axis": 0, "slave": 0, "startup": [{"object": "0x6060", "value": 300}]},
        {"axis": 1, "slave": 1},
    ]
    text = failure(Harness(monkeypatch, axes=axes))
    assert "object 0x6060:00: 300 does not fit in 1 bytes" in text


def test_sync0_runs_with_the_period_of_the_robot(harness: Harness) -> None:
    assert harness.bus.sync0 == {0: (2_000_000, 0, True), 1: (2_000_000, 0, True)}


@pytest.mark.parametrize("drift", [200e-6, -200e-6])
def test_the_control_loop_follows_the_reference_clock(harness: Harness, drift: float) -> None:
    """Frames stay in the middle between two SYNC0, however the clocks drift."""
    harness.bus.bus_drift = drift
    harness.master.observer.begin()
    harness.robot.step(600)
    phases_ns = []
    for _ in range(1200):
        harness.robot.step(1)
        phases_ns.append(harness.master.observer.phase_ns)
    assert phases_ns == pytest.approx([1_000_000] * 1200, abs=3000)
    assert harness.master.observer.drift_ppm == pytest.approx(drift * 1e6, rel=0.02)


def test_without_clocks_no_sync0_is_active(monkeypatch: pytest.MonkeyPatch) -> None:
    harness = Harness(monkeypatch, clocks="off")
    harness.robot.start()
    assert not any(active for _, _, active in harness.bus.sync0.values())
    harness.robot.step(100)
    assert (harness.image.stamp_ns - harness.clock.now_ns()) % 2_000_000 == 0  # nothing is shifted
    harness.robot.shutdown()


def test_an_sdo_abort_names_slave_and_object(harness: Harness) -> None:
    with pytest.raises(OperationError, match=r"joint1 \(slave 0\): reading 0x9999:00: abort"):
        harness.robot.fieldbus.read_object(0, 0, 0x9999)


def test_another_interface_is_rejected(monkeypatch: pytest.MonkeyPatch) -> None:
    device = Harness(monkeypatch).device
    with pytest.raises(InvalidArgument, match="the bus is 'eth0'"):
        device.open("eth7")
    with pytest.raises(NotReady, match="the bus is not open"):
        device.start_communication(1.0)
    with pytest.raises(NotReady, match="the bus is not open"):
        device.scan_network()


def test_stopping_leaves_servos_off_and_the_slaves_in_pre_op(harness: Harness) -> None:
    harness.device.stop_communication(1.0)
    assert all(slave.state is AlState.PRE_OP for slave in harness.bus.all)
    assert harness.slave(0).values[0x6041, 0] & 0x6F != 0x27


def test_a_mapping_that_fails_is_repeated_by_plain_sdo_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    harness = Harness(monkeypatch)
    harness.bus.map_errors = [MappingError("abort", frozenset([1]))]
    harness.robot.start()
    assert harness.bus.plain_sdo == {1}
    harness.robot.connection.stop_communication()
    harness.bus.map_errors = [MappingError("abort again", frozenset([1]))]
    with pytest.raises(ConnectError, match="abort again"):
        harness.robot.connection.start_communication()


def test_complete_access_can_be_switched_off(monkeypatch: pytest.MonkeyPatch) -> None:
    module = {"slave": 2, "input_length": 2, "output_length": 2, "complete_access": False}
    harness = Harness(monkeypatch, io=[module])
    harness.robot.start()
    assert harness.bus.plain_sdo == {2}
