"""A broken driver cannot hurt: errors and hangs are reported with the plugin's name."""

from __future__ import annotations

import re
import sys
import threading
import time
from typing import Any

import numpy as np
import pytest
from tests.fakes import FakeAxes, FakeDevice, FakeFieldbus, FakeIo

from robotd.arrays import FloatArray
from robotd.clock import MonotonicClock, wait_until
from robotd.clock.simulated import SteppedClock
from robotd.control.loop.setpoint_source import Outcome
from robotd.device.drivers import AxisDriver, DeviceDriver, FieldbusDriver, IoDriver
from robotd.device.process_image import ProcessImage
from robotd.device.state import ConnectionState
from robotd.errors import AbandonedCall, NotReady, OperationError, Unsupported
from robotd.motion import TrajectoryRequest
from robotd.plugin import fault_isolation
from robotd.plugin.fault_isolation import isolated
from robotd.realtime import control_loop_thread
from robotd.robot import build_robot

PLUGIN = "'odd' (plugin_acme of acme 1.2)"


def test_calls_pass_with_their_arguments_and_results() -> None:
    device, axes, io = FakeDevice(), FakeAxes(2), FakeIo()
    isolated(device, DeviceDriver, PLUGIN, "odd").open("/dev/bus", name="me")
    assert device.calls == [("open", "/dev/bus", "me")]
    isolated(axes, AxisDriver, PLUGIN, "odd").servo(1, on=True, timeout_s=2.0)
    assert axes.calls == [("servo", 1, True, 2.0)]
    behind = isolated(io, IoDriver, PLUGIN, "odd")
    behind.write_outputs(2, b"\x05")
    assert behind.read_outputs(2, 1) == b"\x05"
    assert (behind.input_bytes, behind.output_bytes) == (8, 8)
    fieldbus = isolated(FakeFieldbus(), FieldbusDriver, PLUGIN, "odd")
    assert fieldbus.buses == 1
    assert len(fieldbus.status(0).nodes) == 2


def test_what_the_cycle_calls_takes_no_other_thread() -> None:
    threads: list[threading.Thread] = []

    class Axes(FakeAxes):
        def read(self, image: ProcessImage) -> None:
            threads.append(threading.current_thread())

        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            threads.append(threading.current_thread())

    behind = isolated(Axes(2), AxisDriver, PLUGIN, "odd")
    behind.read(ProcessImage(2))
    behind.stream(np.zeros(2), np.zeros(2), 0)
    assert threads == [threading.current_thread()] * 2


def test_a_period_in_motion_calls_nothing_with_a_time_limit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    robot = build_robot("cr3a", "sim", clock=SteppedClock())
    robot.start()
    names = robot.joint_names
    request = TrajectoryRequest.from_rows(names, [0.5], [[0.1] * len(names)])
    timed: list[str] = []
    plain = fault_isolation.call_with_timeout

    def note(budget_s: float, call: Any, name: str) -> Any:
        timed.append(name)
        return plain(budget_s, call, name)

    with robot.follower.follow(request) as execution:
        monkeypatch.setattr(fault_isolation, "call_with_timeout", note)
        robot.step(150)
        monkeypatch.undo()
        robot.step(200)
        assert execution.outcome is Outcome.SUCCEEDED
    robot.shutdown()
    assert timed == []


@pytest.mark.parametrize(
    ("fake", "contract", "method"),
    [
        (FakeDevice(), DeviceDriver, "state"),
        (FakeAxes(1), AxisDriver, "read"),
        (FakeAxes(1), AxisDriver, "stream"),
        (FakeIo(), IoDriver, "read_inputs"),
        (FakeIo(), IoDriver, "read_outputs"),
    ],
)
def test_what_is_not_timed_names_the_plugin_too(fake: Any, contract: Any, method: str) -> None:
    def fail(*_: object) -> None:
        raise ZeroDivisionError("no scale")

    setattr(fake, method, fail)
    with pytest.raises(OperationError) as caught:
        getattr(isolated(fake, contract, PLUGIN, "odd"), method)()
    says = f"plugin {PLUGIN}: {contract.__name__}.{method} failed: ZeroDivisionError: no scale"
    assert re.fullmatch(re.escape(says) + r" \(test_fault_isolation.py:\d+\)", str(caught.value))


def test_a_property_that_raises_names_the_plugin() -> None:
    class Odd(FakeFieldbus):
        @property
        def buses(self) -> int:
            raise OSError("no bus")

    with pytest.raises(OperationError) as caught:
        _ = isolated(Odd(), FieldbusDriver, PLUGIN, "odd").buses
    says = f"plugin {PLUGIN}: FieldbusDriver.buses failed: OSError: no bus"
    assert re.fullmatch(re.escape(says) + r" \(test_fault_isolation.py:\d+\)", str(caught.value))


def test_a_device_that_does_not_answer_is_in_unknown_state(monkeypatch: pytest.MonkeyPatch) -> None:
    asked, answered = threading.Event(), threading.Event()

    class Silent(FakeDevice):
        def state(self) -> ConnectionState:
            asked.set()
            answered.wait(20.0)
            return super().state()

    monkeypatch.setattr(fault_isolation, "ANSWER_BUDGET_S", 0.02)
    behind = isolated(Silent(), DeviceDriver, PLUGIN, "odd")
    first = threading.Thread(target=behind.state)
    first.start()
    try:
        assert asked.wait(5.0)
        assert behind.state() is ConnectionState.UNKNOWN
    finally:
        answered.set()
        first.join(5.0)
    assert behind.state() is ConnectionState.IDLE


def test_a_device_that_cannot_say_why_is_told_and_asked_no_more(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    released, asked = threading.Event(), list[str]()

    class Silent(FakeDevice):
        def fault(self) -> str:
            asked.append("why")
            released.wait(20.0)
            return "bus off"

    monkeypatch.setattr(fault_isolation, "ANSWER_BUDGET_S", 0.02)
    behind = isolated(Silent(), DeviceDriver, PLUGIN, "odd")
    told = [behind.fault() for _ in range(3)]
    assert told == [f"plugin {PLUGIN}: DeviceDriver.fault does not return"] * 3
    assert len(asked) == 1
    released.set()
    assert wait_until(lambda: behind.fault() == "bus off", 5.0, MonotonicClock())


def test_a_late_answer_makes_the_state_unknown_for_no_longer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(fault_isolation, "ANSWER_BUDGET_S", 0.0)  # every answer is late
    behind = isolated(FakeDevice(), DeviceDriver, PLUGIN, "odd")
    assert behind.state() is ConnectionState.IDLE
    with control_loop_thread():
        assert behind.state() is ConnectionState.IDLE


def test_a_fault_that_is_not_answered_is_waited_for_once(monkeypatch: pytest.MonkeyPatch) -> None:
    hung = threading.Event()

    class Stuck(FakeDevice):
        def fault(self) -> str:
            hung.wait(10.0)
            return ""

    monkeypatch.setattr(fault_isolation, "ANSWER_BUDGET_S", 0.2)
    behind = isolated(Stuck(), DeviceDriver, PLUGIN, "stuck")
    behind.fault()
    began_s = time.monotonic()
    for _ in range(50):  # rejected commands, in the thread that also takes stops
        assert behind.fault() == f"plugin {PLUGIN}: DeviceDriver.fault does not return"
    assert time.monotonic() - began_s < 0.2
    hung.set()
    assert wait_until(lambda: behind.fault() == "", 5.0, MonotonicClock())


def test_a_fault_that_raises_is_a_text() -> None:
    device = FakeDevice()
    device.fault = lambda: {}["bus"]  # type: ignore[method-assign]
    says = f"plugin {PLUGIN}: DeviceDriver.fault failed: KeyError: 'bus'"
    assert isolated(device, DeviceDriver, PLUGIN, "odd").fault().startswith(f"{says} (test_")


def test_a_foreign_error_becomes_one_of_robotd_with_the_plugins_name() -> None:
    axes = FakeAxes(1)
    axes.failures["servo"] = KeyError("bus")
    with pytest.raises(OperationError) as caught:
        isolated(axes, AxisDriver, PLUGIN, "odd").servo(0, True, 1.0)
    says = f"plugin {PLUGIN}: AxisDriver.servo failed: KeyError: 'bus' (fakes.py:"
    assert str(caught.value).startswith(says)
    assert isinstance(caught.value.__cause__, KeyError)


def test_a_driver_cannot_end_the_process() -> None:
    axes = FakeAxes(1)
    axes.read = lambda image: sys.exit(3)  # type: ignore[method-assign]
    with pytest.raises(OperationError, match=r"AxisDriver\.read failed: SystemExit: 3"):
        isolated(axes, AxisDriver, PLUGIN, "odd").read(ProcessImage(1))


def test_an_error_of_robotd_passes_as_it_is() -> None:
    axes = FakeAxes(1)
    axes.failures["move"] = NotReady("servo is off")
    with pytest.raises(NotReady, match=r"^servo is off$"):
        isolated(axes, AxisDriver, PLUGIN, "odd").move(0, 1.0, None)  # type: ignore[arg-type]


def test_a_call_that_does_not_return_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    released = threading.Event()

    class Endless(FakeAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            released.wait(20.0)

        def stop(self, axes: object) -> None:
            released.wait(20.0)

    monkeypatch.setattr(fault_isolation, "GRACE_S", 0.02)
    monkeypatch.setattr(fault_isolation, "COMMAND_BUDGET_S", 0.05)
    behind = isolated(Endless(1), AxisDriver, PLUGIN, "odd")
    try:
        with pytest.raises(AbandonedCall) as caught:
            behind.servo(0, True, timeout_s=0.03)
        assert str(caught.value) == (
            f"plugin {PLUGIN}: AxisDriver.servo did not return within 0.05 s"
        )
        with pytest.raises(AbandonedCall, match="stop did not return"):
            behind.stop([0])
    finally:
        released.set()


def test_the_drivers_of_the_plugin_can_be_looked_at() -> None:
    device = FakeDevice()
    assert isolated(device, DeviceDriver, PLUGIN, "odd").wrapped is device  # type: ignore[attr-defined]


def test_a_feature_that_is_not_there_names_the_backend() -> None:
    axes = FakeAxes(1)
    axes.failures["home"] = Unsupported("homing")
    with pytest.raises(Unsupported, match=r"^homing: not supported by the odd backend$"):
        isolated(axes, AxisDriver, PLUGIN, "odd").home(0, 1.0)
