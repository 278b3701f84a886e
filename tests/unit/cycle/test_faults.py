"""What goes wrong while a trajectory runs, how it ends, and that all works again afterwards."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.unit.cycle.rig import ACCELERATION, PERIOD_S, Rig, arm

from robotd.cycle.execution import Execution, Outcome
from robotd.device.image import ProcessImage
from robotd.device.state import EngineState, Operation
from robotd.errors import ConnectError, NotReady

FAR = (1.0, -0.6, 0.3)
HOME = (0.0, 0.0, 0.0)
OTHERS = [1, 2]


@pytest.fixture
def rig() -> Rig:
    return Rig().up()


def assert_fault(execution: Execution, reason: str) -> None:
    assert execution.outcome is Outcome.FAULT
    assert reason in execution.message


def assert_works(rig: Rig) -> None:
    """Recover as an operator does, and go home."""
    rig.robot.enable_joints()
    before = len(rig.setpoints.rows)
    with rig.goal(HOME, seconds=1.5) as execution:
        rig.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED, execution.message
    assert rig.image.position == pytest.approx(HOME, abs=1e-3)
    begin = rig.setpoints.rows[before]
    assert np.abs(begin[2]).max() < 0.05
    rig.setpoints.rows = rig.setpoints.rows[before:]
    rig.setpoints.assert_smooth(ACCELERATION)


def test_an_alarm_of_one_axis_stops_the_others_along_the_path(rig: Rig) -> None:
    with rig.goal(FAR) as execution:
        rig.run(0.41)
        rig.faults.trip(0, 16)
        rig.end(execution)
        rows = len(rig.setpoints.rows)
        rig.run(0.1)
        assert len(rig.setpoints.rows) == rows, "nothing is streamed after a fault"
    assert_fault(execution, "joint1 at 0.4")
    assert execution.message.endswith("amplifier alarm 16 (error 0x0010)")
    rig.setpoints.assert_smooth(ACCELERATION)
    position = rig.setpoints.position
    assert np.abs(position[:, 1] / FAR[1] - position[:, 2] / FAR[2]).max() < 1e-9
    assert rig.image.position[OTHERS] == pytest.approx(position[-1, OTHERS], abs=1e-3)
    assert_works(rig)


def test_a_servo_that_is_switched_off_is_a_fault(rig: Rig) -> None:
    with rig.goal(FAR) as execution:
        rig.run(0.41)
        rig.robot.axes.servo(1, False)
        rig.end(execution)
    assert_fault(execution, "joint2 at 0.4")
    assert execution.message.endswith("servo went off")
    assert_works(rig)


def test_a_servo_cannot_be_switched_on_under_a_running_goal(rig: Rig) -> None:
    with rig.goal(FAR) as execution:
        rig.run(0.4)
        rig.robot.axes.servo(1, True)  # it is on: no effect
        rig.robot.axes.servo(1, False)
        with pytest.raises(NotReady, match="joint2 is in use by follow_joint_trajectory"):
            rig.robot.axes.servo(1, True)
        rig.end(execution)
    assert_works(rig)


def test_a_drive_that_is_lost_is_a_fault_until_it_is_back(rig: Rig) -> None:
    with rig.goal(FAR) as execution:
        rig.run(0.41)
        rig.faults.disconnect(2)
        rig.end(execution)
    assert_fault(execution, "joint3 at 0.4")
    assert execution.message.endswith(
        "drive is offline (slave 2 does not answer: cable or power supply)"
    )
    with pytest.raises(NotReady, match="joint3: drive is offline"), rig.goal(HOME):
        pass
    rig.robot.fieldbus.start_hot_connect(0)
    rig.run(0.5)
    assert_works(rig)


@pytest.mark.parametrize("how", ["stop", "quick_stop"])
def test_a_stop_from_elsewhere_ends_the_goal_and_all_joints(rig: Rig, how: str) -> None:
    with rig.goal(FAR) as execution:
        rig.run(0.41)
        getattr(rig.robot.axes, how)([0])
        rig.end(execution)
    assert_fault(execution, "joint1 at 0.4")
    assert execution.message.endswith("stopped by the device or another command")
    assert np.abs(rig.image.velocity).max() < 0.01
    assert rig.image.position[2] < 0.8 * FAR[2]
    with rig.goal(HOME, seconds=1.5) as execution:
        rig.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED, "no recovery is needed: the servos are on"


def test_a_cycle_that_stood_too_long_is_named_as_the_reason(rig: Rig) -> None:
    with rig.goal(FAR) as execution:
        rig.run(0.4)
        rig.stall(0.3)
        rig.end(execution)
    assert_fault(execution, "joint1 at 0.")
    assert execution.message.endswith(
        "stopped by the device after the cycle had stood for 302 ms (setpoints stayed away)"
    )
    assert_works(rig)


@pytest.mark.parametrize(
    ("array", "value", "reason"),
    [
        ("amp_alarm", True, "amplifier alarm 33"),
        ("servo_on", False, "servo went off"),
        ("offline", True, "drive is offline"),
        ("operation", Operation.IDLE, "stopped by the device or another command"),
    ],
)
def test_each_sign_of_a_fault_is_enough(rig: Rig, array: str, value: Any, reason: str) -> None:
    """Also on a device that shows nothing else of it."""
    driver = rig.robot.cycle._driver
    read, broken = driver.read, False

    def spoiled(image: ProcessImage) -> None:
        read(image)
        if broken:
            getattr(image, array)[1] = value
            image.alarm_code[1] = 33

    driver.read = spoiled  # type: ignore[method-assign]
    with rig.goal(FAR) as execution:
        rig.run(0.41)
        broken = True
        rig.end(execution)
        broken = False
    assert_fault(execution, "joint2 at 0.4")
    assert execution.message.endswith(reason)
    rig.setpoints.assert_smooth(ACCELERATION)


def test_a_goal_that_waits_for_a_stopped_one_claims_the_axes_anew(rig: Rig) -> None:
    with rig.goal(FAR) as first:
        rig.run(0.4)
        rig.robot.axes.stop([0, 1, 2])
        rig.run(2 * PERIOD_S)
        with rig.goal(HOME, seconds=1.5) as second:  # while the first one still ends
            assert first.outcome is Outcome.FAULT
            rig.end(second)
    assert second.outcome is Outcome.SUCCEEDED, second.message


def test_a_fault_during_a_cancel_is_told(rig: Rig) -> None:
    with rig.goal(FAR) as execution:
        rig.run(0.5)
        execution.cancel()
        rig.run(0.02)
        rig.faults.trip(2, 5)
        rig.end(execution)
    assert_fault(
        execution, "amplifier alarm 5 (error 0x0005) (while stopping: canceled by the client)"
    )
    assert_works(rig)


def test_a_fault_at_the_end_of_the_path_is_no_success(rig: Rig) -> None:
    with rig.goal(FAR) as execution:
        rig.run(1.002)
        rig.faults.trip(2, 5)
        rig.end(execution)
    assert_fault(execution, "joint3 at 1.000 s: amplifier alarm 5")


def test_a_goal_that_waits_for_its_time_watches_its_drives(rig: Rig) -> None:
    with rig.goal(FAR, start_in_s=5.0) as execution:
        rig.run(0.1)
        rig.faults.trip(0, 7)
        rig.run(0.1)
        assert_fault(execution, "amplifier alarm 7")


def test_a_lost_communication_ends_what_runs_and_what_waits(rig: Rig) -> None:
    with rig.goal(FAR) as first:
        rig.run(0.4)
        with rig.goal(HOME, start_in_s=0.5) as waiting:
            rig.faults.drop_communication()
            rig.run(PERIOD_S)
            for execution in (first, waiting):
                assert_fault(execution, "engine is Running")
    assert not rig.engine.ready
    assert np.isnan(rig.image.position).all()
    assert rig.image.offline.all()
    with pytest.raises(NotReady, match=r"engine is not ready \(state Running\)"), rig.goal(HOME):
        pass
    rig.engine.start_communication()
    with pytest.raises(NotReady, match="joint1: servo is off"), rig.goal(HOME):
        rig.run(PERIOD_S)
    assert_works(rig)


def test_the_device_adds_why_it_communicates_no_more(rig: Rig) -> None:
    asked: list[int] = []
    rig.engine._driver.fault = lambda: asked.append(0) or "somebody pulled the plug"  # type: ignore[method-assign]
    with rig.goal(FAR) as execution:
        rig.run(0.2)
        rig.faults.drop_communication()
        rig.run(0.1)
    assert_fault(execution, "engine is Running: somebody pulled the plug")
    assert len(asked) == 1, "the device is not asked again in every period"


def test_nothing_can_be_commanded_before_the_first_image(rig: Rig) -> None:
    rig.faults.drop_communication()
    rig.run(PERIOD_S)
    rig.clock.detach()
    rig.engine.start_communication()
    assert rig.engine.ready
    with pytest.raises(NotReady, match="joint1: drive is offline"), rig.goal(HOME):
        pass
    rig.clock.attach(rig.robot.cycle.period_ns, rig.robot.cycle.period)


@pytest.mark.parametrize("restart", ["communication", "device"])
def test_the_engine_is_stopped_and_started_under_a_goal(rig: Rig, restart: str) -> None:
    with rig.goal(FAR) as execution:
        rig.run(0.4)
        if restart == "device":
            rig.engine.close()
        else:
            rig.engine.stop_communication()
    assert execution.outcome is Outcome.CANCELED
    rig.setpoints.assert_smooth(ACCELERATION)
    assert not rig.simulation.states.servo_on.any()
    rig.engine.open()
    rig.engine.start_communication()
    rig.run(PERIOD_S)
    assert not rig.image.servo_on.any(), "nothing switches on by itself"
    assert_works(rig)


@pytest.fixture
def frozen(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> Rig:
    """0.4 s into a trajectory the values stop coming, without the device saying so."""
    read = rig.robot.cycle._driver.read

    def stale(image: object) -> None:
        fresh_ns = rig.image.fresh_ns
        read(rig.image)
        rig.image.fresh_ns = fresh_ns

    rig.freeze = lambda: setattr(rig.robot.cycle._driver, "read", stale)  # type: ignore[attr-defined]
    rig.thaw = lambda: setattr(rig.robot.cycle._driver, "read", read)  # type: ignore[attr-defined]
    return rig


def test_old_values_end_the_goal_and_readiness(frozen: Rig) -> None:
    rig, heard = frozen, []
    rig.engine.on_ready(heard.append)
    with rig.goal(FAR) as execution:
        rig.run(0.4)
        rig.freeze()  # type: ignore[attr-defined]
        rig.run(0.098)
        assert not execution.done
        rig.run(0.006)
        assert_fault(execution, "the fieldbus values are 102 ms old")
        assert rig.engine.state is EngineState.UNKNOWN
        with pytest.raises(NotReady, match=r"engine is not ready \(state Unknown\)"):
            rig.robot.axes.servo(0, True)
        rows = len(rig.setpoints.rows)
        rig.run(0.5)
        assert len(rig.setpoints.rows) == rows, "nothing is streamed blindly"
    rig.thaw()  # type: ignore[attr-defined]
    rig.run(PERIOD_S)
    assert rig.engine.ready
    assert heard == [True, False, True]
    assert_works(rig)


def test_a_read_that_fails_is_survived_for_a_while(rig: Rig) -> None:
    driver = rig.robot.cycle._driver
    read = driver.read

    def fail(image: object) -> None:
        raise OSError("no frame")

    with rig.goal(FAR) as execution:
        rig.run(0.3)
        driver.read = fail  # type: ignore[method-assign]
        rig.run(0.05)
        driver.read = read  # type: ignore[method-assign]
        rig.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED
    rig.setpoints.assert_smooth(ACCELERATION)
    with rig.goal(HOME) as execution:
        rig.run(0.3)
        driver.read = fail  # type: ignore[method-assign]
        rig.run(0.2)
        assert_fault(execution, "OSError: no frame")
    driver.read = read  # type: ignore[method-assign]
    rig.run(0.5)
    assert_works(rig)


def test_a_driver_that_cannot_stream_ends_the_goal_not_the_cycle(rig: Rig) -> None:
    driver = rig.streamer._driver
    stream = driver.stream

    def fail(position: object, velocity: object) -> None:
        raise OSError("bus off")

    with rig.goal(FAR) as execution:
        rig.run(0.3)
        driver.stream = fail  # type: ignore[method-assign]
        rig.run(2 * PERIOD_S)
        assert_fault(execution, "OSError: bus off")
    driver.stream = stream  # type: ignore[method-assign]
    rig.run(0.5)
    assert_works(rig)


def test_recovery_names_every_joint_that_does_not_come_up(rig: Rig) -> None:
    for axis in (0, 2):
        rig.faults.disconnect(axis)
    rig.run(PERIOD_S)
    with pytest.raises(ConnectError) as caught:
        rig.robot.enable_joints()
    assert list(caught.value.failures) == ["arm → joint1", "arm → joint3"]
    assert all("offline" in reason for reason in caught.value.failures.values())
    assert rig.image.servo_on.tolist() == [False, True, False]


def test_recovery_right_after_an_alarm_needs_no_patience() -> None:
    """Also where the image is slower than the drives: the alarm is gone, but not yet from it."""
    rig = Rig(arm(cycle={"rate_hz": 50.0, "realtime_priority": 0})).up()
    for axis in range(3):
        rig.faults.trip(axis, 9)
    rig.run(0.02)
    assert rig.image.amp_alarm.all()
    rig.robot.enable_joints()
    assert rig.image.servo_on.all()
    assert not rig.image.amp_alarm.any()
