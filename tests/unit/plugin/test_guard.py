"""A broken driver cannot hurt: what it raises or never returns is told with the plugin's name."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from robotd.device.drivers import AxisDriver, DeviceDriver, FieldbusDriver, IoDriver
from robotd.device.image import ProcessImage
from robotd.device.state import EngineState
from robotd.errors import DeviceTimeout, NotReady, OperationError
from robotd.plugin import guard as guard_module
from robotd.plugin.guard import guarded, unguarded
from robotd.testing.fakes import FakeAxes, FakeDevice, FakeFieldbus, FakeIo

PLUGIN = "'odd' (plugin_acme of acme 1.2)"


def test_calls_pass_with_their_arguments_and_results() -> None:
    device, axes, io = FakeDevice(), FakeAxes(2), FakeIo()
    guarded(device, DeviceDriver, PLUGIN).open("/dev/bus", name="me")
    assert device.calls == [("open", "/dev/bus", "me")]
    guarded(axes, AxisDriver, PLUGIN).servo(1, on=True, timeout_s=2.0)
    assert axes.calls == [("servo", 1, True, 2.0)]
    behind = guarded(io, IoDriver, PLUGIN)
    behind.write_outputs(2, b"\x05")
    assert behind.read_outputs(2, 1) == b"\x05"
    assert (behind.input_bytes, behind.output_bytes) == (8, 8)
    fieldbus = guarded(FakeFieldbus(), FieldbusDriver, PLUGIN)
    assert fieldbus.masters == 1
    assert len(fieldbus.network_state(0).slaves) == 2


def test_what_the_cycle_calls_is_not_wrapped() -> None:
    axes = FakeAxes(2)
    behind = guarded(axes, AxisDriver, PLUGIN)
    assert behind.read == axes.read
    assert behind.stream == axes.stream
    behind.read(ProcessImage(2))
    behind.stream(np.zeros(2), np.zeros(2))


def test_a_device_that_does_not_answer_is_in_unknown_state(monkeypatch: pytest.MonkeyPatch) -> None:
    asked, answered = threading.Event(), threading.Event()

    class Silent(FakeDevice):
        def state(self) -> EngineState:
            asked.set()
            answered.wait(20.0)
            return super().state()

    monkeypatch.setattr(guard_module, "STATE_BUDGET_S", 0.02)
    behind = guarded(Silent(), DeviceDriver, PLUGIN)
    first = threading.Thread(target=behind.state)
    first.start()
    try:
        assert asked.wait(5.0)
        assert behind.state() is EngineState.UNKNOWN
    finally:
        answered.set()
        first.join(5.0)
    assert behind.state() is EngineState.IDLE


def test_a_foreign_error_becomes_one_of_robotd_with_the_plugins_name() -> None:
    axes = FakeAxes(1)
    axes.failures["servo"] = KeyError("bus")
    with pytest.raises(OperationError) as caught:
        guarded(axes, AxisDriver, PLUGIN).servo(0, True, 1.0)
    assert str(caught.value) == f"plugin {PLUGIN}: AxisDriver.servo failed: KeyError: 'bus'"
    assert isinstance(caught.value.__cause__, KeyError)


def test_an_error_of_robotd_passes_as_it_is() -> None:
    axes = FakeAxes(1)
    axes.failures["move"] = NotReady("servo is off")
    with pytest.raises(NotReady, match=r"^servo is off$"):
        guarded(axes, AxisDriver, PLUGIN).move(0, 1.0, None)  # type: ignore[arg-type]


def test_a_call_that_does_not_return_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    released = threading.Event()

    class Endless(FakeAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            released.wait(20.0)

        def stop(self, axes: object) -> None:
            released.wait(20.0)

    monkeypatch.setattr(guard_module, "GRACE_S", 0.02)
    monkeypatch.setattr(guard_module, "CALL_BUDGET_S", 0.05)
    behind = guarded(Endless(1), AxisDriver, PLUGIN)
    try:
        with pytest.raises(DeviceTimeout) as caught:
            behind.servo(0, True, timeout_s=0.03)
        assert str(caught.value) == (
            f"plugin {PLUGIN}: AxisDriver.servo did not return within 0.05 s"
        )
        with pytest.raises(DeviceTimeout, match="stop did not return"):
            behind.stop([0])
    finally:
        released.set()


def test_the_plugin_gets_its_own_driver_back() -> None:
    device = FakeDevice()
    assert unguarded(guarded(device, DeviceDriver, PLUGIN)) is device
    assert unguarded(device) is device
