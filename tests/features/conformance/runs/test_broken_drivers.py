"""A robot on a driver that raises or hangs: not ready, told with its name, ended in time."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
from tests.features.conformance.runs.broken import (
    HangsInClose,
    HangsInRead,
    HangsInServo,
    HangsInState,
    RaisesInRead,
    RaisesInServo,
    broken,
    released,
)
from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.clock import MonotonicClock, wait_until
from robotd.descriptor import RobotDescriptor
from robotd.device.state import ConnectionState
from robotd.errors import ConnectError, DeviceTimeout, NotReady, OperationError
from robotd.plugin import fault_isolation
from robotd.plugin.manager import Backend, PluginOrigin
from robotd.robot import Robot


@pytest.fixture(autouse=True)
def whole(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Budgets of tenths of a second, and nothing broken or hanging before and after a test."""
    for name in ("CALL_BUDGET_S", "COMMAND_BUDGET_S", "GRACE_S", "ANSWER_BUDGET_S"):
        monkeypatch.setattr(fault_isolation, name, 0.1)
    monkeypatch.setattr("robotd.control.loop.control_loop.STOP_TIMEOUT_S", 0.2)
    monkeypatch.setattr("robotd.control.loop.watchdog.HANG_TIMEOUT_S", 0.1)
    monkeypatch.setattr("robotd.device.connection.STATE_TIMEOUT_S", 0.2)
    broken.clear()
    released.clear()
    yield
    released.set()


def make(mutant: type[Mutant]) -> Robot:
    keys = {"schema": 1, "name": "bare", "axes": 2, "engine": {"servo_timeout_s": 0.1}}
    origin = PluginOrigin(mutant.__name__, "acme", "robotd-acme", "1.0")
    return Robot(RobotDescriptor.model_validate(keys), Backend(origin, mutant()), MonotonicClock())


def waits(condition: object) -> bool:
    assert callable(condition)
    return wait_until(condition, 5.0, MonotonicClock())


@pytest.mark.parametrize("mutant", [RaisesInRead, HangsInRead, HangsInState])
def test_a_cycle_that_cannot_read_takes_no_command_and_can_be_ended(mutant: type[Mutant]) -> None:
    robot = make(mutant)
    robot.start()
    assert waits(lambda: robot.connection.ready)
    broken.set()
    assert waits(lambda: not robot.connection.ready)
    with pytest.raises(NotReady, match="engine is not ready"):
        robot.axes.servo(0, True)
    began_s = time.monotonic()
    robot.shutdown()
    assert time.monotonic() - began_s < 15.0, "the hang lasts 20 s"
    assert robot.connection.state is ConnectionState.SHUTDOWN


def test_a_command_that_hangs_or_raises_names_the_plugin() -> None:
    for mutant, kind, says in (
        (HangsInServo, DeviceTimeout, "AxisDriver.servo did not return within 0.2 s"),
        (RaisesInServo, OperationError, "AxisDriver.servo failed: KeyError: 'controlword'"),
    ):
        robot = make(mutant)
        robot.start()
        assert waits(lambda robot=robot: robot.connection.ready)
        with pytest.raises(kind) as caught:
            robot.axes.servo(0, True)
        assert f"plugin {mutant.__name__!r} (acme of robotd-acme 1.0): {says}" in str(caught.value)
        assert robot.connection.ready
        robot.shutdown()


def test_a_device_that_does_not_close_is_left_to_itself() -> None:
    robot = make(HangsInClose)
    robot.start()
    robot.shutdown()
    assert robot.connection.state is ConnectionState.SHUTDOWN


def test_an_arm_whose_servos_hang_says_which() -> None:
    robot = make(HangsInServo)
    robot.servos.used = (0, 1)
    with pytest.raises(ConnectError, match=r"AxisDriver\.servo did not return"):
        robot.start()
    robot.shutdown()
