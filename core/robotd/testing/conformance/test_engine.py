"""States and their transitions; start-up and shut-down in any order, and twice."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from robotd.device.capabilities import Capability
from robotd.device.state import EngineState
from robotd.errors import NotReady, RobotdError
from robotd.testing.conformance.rig import SETTLED_RAD, MakeRig, Rig


def test_a_device_that_is_made_is_idle(make_rig: MakeRig) -> None:
    assert make_rig().parts.device.state() is EngineState.IDLE


def test_the_states_follow_the_calls(make_rig: MakeRig) -> None:
    rig = make_rig()
    device = rig.parts.device
    rig.begin()
    seen = []
    calls: list[Callable[[], None]] = [
        device.open,
        lambda: device.start_communication(10.0),
        lambda: device.stop_communication(10.0),
        lambda: device.start_communication(10.0),
        device.close,
    ]
    for call in calls:
        call()
        seen.append(device.state().name)
    assert seen == ["RUNNING", "COMMUNICATING", "RUNNING", "COMMUNICATING", "IDLE"]


def test_every_call_may_come_twice(make_rig: MakeRig) -> None:
    engine = make_rig().robot.engine
    for call, state in (
        (engine.open, EngineState.RUNNING),
        (engine.start_communication, EngineState.COMMUNICATING),
        (engine.stop_communication, EngineState.RUNNING),
        (engine.close, EngineState.IDLE),
        (engine.shutdown, EngineState.SHUTDOWN),
    ):
        call()
        call()
        assert engine.state is state


def test_closing_a_device_twice_or_unopened_is_no_error(make_rig: MakeRig) -> None:
    device = make_rig().parts.device
    device.close()
    device.open()
    device.close()
    device.close()
    assert device.state() is EngineState.IDLE


def test_calls_out_of_order_are_refused_or_have_no_effect(make_rig: MakeRig) -> None:
    engine = make_rig().robot.engine
    with pytest.raises(NotReady):
        engine.start_communication()
    with pytest.raises(NotReady):
        engine.scan_network()
    engine.stop_communication()
    engine.close()
    assert engine.state is EngineState.IDLE


def test_communication_without_an_open_device_is_refused(make_rig: MakeRig) -> None:
    device = make_rig().parts.device
    with pytest.raises(RobotdError):
        device.start_communication(1.0)
    assert device.state() is EngineState.IDLE


def test_it_works_again_after_it_was_closed(make_rig: MakeRig) -> None:
    rig = make_rig()
    for _ in range(2):
        rig.up()
        targets = rig.image.position_command + rig.travel(0.3)
        rig.move(rig.all, targets)
        rig.rest()
        assert np.abs(rig.image.position - targets).max() <= SETTLED_RAD
        rig.robot.engine.close()
        rig.until(lambda: not rig.robot.engine.ready, "the engine is not ready once it is closed")


def test_starting_enables_and_moves_nothing(make_rig: MakeRig) -> None:
    rig = make_rig()
    rig.up(enable=False)
    start = rig.image.position.copy()
    rig.let(0.3)
    assert not rig.image.servo_on.any()
    assert np.abs(rig.image.position - start).max() <= SETTLED_RAD


def test_servos_are_off_after_communication_stopped(make_rig: MakeRig) -> None:
    rig = make_rig()
    rig.up()
    rig.parts.device.stop_communication(10.0)
    rig.periods(3)
    rig.robot.engine.start_communication()
    rig.until(lambda: rig.robot.engine.ready, "the engine is ready again")
    rig.let(0.3)
    assert not rig.image.servo_on.any(), "nothing may enable a servo by itself"


def test_closing_while_axes_move_is_orderly(make_rig: MakeRig) -> None:
    rig = make_rig()
    rig.up()
    rig.move(rig.all, rig.image.position_command + rig.travel())
    rig.let(0.15)
    rig.robot.shutdown()
    assert rig.robot.engine.state is EngineState.SHUTDOWN
    assert rig.parts.device.state() is EngineState.IDLE


def test_a_scan_is_one_line_for_people(rig: Rig) -> None:
    line = rig.robot.engine.scan_network()
    assert line.strip()
    assert "\n" not in line


@pytest.mark.needs(Capability.PARAMETERS_FILE)
def test_parameters_can_be_shown_for_every_axis(rig: Rig) -> None:
    for axis in rig.all:
        assert rig.robot.engine.dump_parameters(axis).strip()


@pytest.mark.needs(Capability.PARAMETERS_FILE)
def test_a_bad_parameter_file_changes_nothing(rig: Rig, tmp_path: Path) -> None:
    bad = tmp_path / "parameters.xml"
    bad.write_text("<Parameters><not closed", encoding="utf-8")
    before = [rig.robot.engine.dump_parameters(axis) for axis in rig.all]
    with pytest.raises(RobotdError):
        rig.robot.engine.load_parameters(bad)
    assert [rig.robot.engine.dump_parameters(axis) for axis in rig.all] == before
