"""The native binding against the stand-in: states, errors, arrays and blocking calls."""

from __future__ import annotations

import contextlib
import gc
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest

from robotd_wmx import _native
from robotd_wmx._native import CallError, Device, Master, Snapshot, State, StatusReader
from robots import eventually
from standin_port import port

AXES = 6


@pytest.fixture
def device() -> Iterator[Device]:
    device = Device()
    device.create(_native.SDK_PATH, 5000)
    device.start_communication(5000)
    yield device
    with contextlib.suppress(CallError):
        device.close(False)


def make_reader(
    device: Device, axes: int = AXES, position: int | None = None
) -> tuple[StatusReader, list[np.ndarray]]:
    arrays: list[np.ndarray] = [np.ones(axes), np.ones(axes)]
    arrays += [np.full(axes if n or position is None else position, np.nan) for n in range(5)]
    arrays += [np.zeros(axes, bool) for _ in range(8)]
    arrays += [np.zeros(axes, np.int64) for _ in range(3)]
    return StatusReader(device, *arrays), arrays


def test_states_of_the_engine() -> None:
    port("communication_ms", 0)
    device = Device()
    device.create(_native.SDK_PATH, 5000)
    assert device.state() is State.RUNNING
    device.start_communication(5000)
    assert device.state() is State.COMMUNICATING
    device.stop_communication(5000)
    assert device.state() is State.RUNNING
    device.stop_engine(5000)
    assert device.state() is State.SHUTDOWN
    device.close(False)


def test_a_failed_call_says_which_with_class_code_and_name() -> None:
    with pytest.raises(CallError) as failed:
        Device().state()
    assert failed.value.args[:4] == ("GetEngineStatus", "engine", 301, "DeviceIsNull")


def test_no_engine_at_a_path() -> None:
    with pytest.raises(CallError) as failed:
        Device().create("/nowhere/", 1000)
    assert failed.value.args[3] == "RtssFileNotFoundError"


def test_codes_of_a_base_class_are_named_too(device: Device) -> None:
    with pytest.raises(CallError) as failed:
        device.set_servo(200, True)
    assert failed.value.args[1:4] == ("core motion", 1547, "AxisOutOfRange")
    with pytest.raises(CallError) as failed:
        device.start_spline(0, [0], np.array([1.0, 2.0]), np.zeros((2, 1)))
    assert failed.value.args[1] == "advanced motion"
    assert failed.value.args[3] == "NotServoOn"


def test_all_devices_are_listed_with_their_names(device: Device) -> None:
    other = Device()
    other.create(_native.SDK_PATH, 5000)
    other.set_name("other")
    assert [name for _, name in device.devices()] == ["", "other"]
    other.close(False)
    assert [number for number, _ in device.devices()] == [device.id()]


def test_status_is_written_into_the_arrays(device: Device) -> None:
    reader, arrays = make_reader(device)
    arrays[0][:] = 2.0  # SI per user unit
    arrays[1][:] = 0.3  # N·m per percent
    device.set_servo(1, True)
    port("torque", 1, 50)
    port("home_switch", 2, 1)
    port("amp_alarm", 3, 0x1234)
    eventually(lambda: Snapshot(device).servo_on(1))
    device.start_pos(1, 10.0, 50.0, 1000.0, 1000.0)
    eventually(lambda: Snapshot(device).motion_complete(1))
    eventually(lambda: reader.read() > 0 and arrays[2][1] == 20.0)
    assert reader.communicating
    (_, _, position, _, torque, command, _, servo_on, amp_alarm, offline, *_) = arrays
    np.testing.assert_array_equal(position[:3], [0.0, 20.0, 0.0])
    np.testing.assert_array_equal(command[:3], [0.0, 20.0, 0.0])
    assert torque[1] == pytest.approx(15.0)
    np.testing.assert_array_equal(servo_on, [0, 1, 0, 0, 0, 0])
    np.testing.assert_array_equal(amp_alarm, [0, 0, 0, 1, 0, 0])
    assert not offline.any()
    assert arrays[11][2]  # home switch
    assert arrays[15][3] == 0x1234


def test_arrays_of_different_shapes_are_rejected(device: Device) -> None:
    with pytest.raises(ValueError, match="one shape"):
        make_reader(device, position=AXES + 1)


def test_arrays_live_as_long_as_their_reader(device: Device) -> None:
    reader, arrays = make_reader(device)
    del arrays
    gc.collect()
    assert reader.read() >= 0


def test_a_read_does_not_wait_for_the_engine(device: Device) -> None:
    """The engine has a cycle of 1 ms; a read takes some microseconds."""
    reader, _ = make_reader(device)
    costs_ns = []
    for _ in range(5000):
        start_ns = time.perf_counter_ns()
        reader.read()
        costs_ns.append(time.perf_counter_ns() - start_ns)
    assert np.median(costs_ns) < 300_000


def test_other_threads_run_while_a_call_blocks() -> None:
    port("communication_ms", 300)
    device = Device()
    device.create(_native.SDK_PATH, 5000)
    caller = threading.Thread(target=device.start_communication, args=(5000,))
    caller.start()
    turns = 0
    while caller.is_alive():
        turns += 1
    caller.join()
    assert turns > 10_000
    device.close(False)


def test_states_on_the_wire(device: Device) -> None:
    port("slave_lost", 3)
    master = Master(device, 0)
    assert master.state == 16
    assert [slave.state for slave in master.slaves] == [16, 16, 16, 0, 16, 16, 16]
