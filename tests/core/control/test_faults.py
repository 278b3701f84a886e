"""Faults during a trajectory: outcome, and recovery afterwards."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from tests.core.control.harness import ACCELERATION, FAR, HOME, PERIOD_S, Harness, arm

from robotd.control.loop.setpoint_source import Outcome
from robotd.control.sources.trajectory_execution import TrajectoryExecution
from robotd.device.axes import Jog, Move
from robotd.device.process_image import ProcessImage
from robotd.device.state import CommandMode, ConnectionState, Operation
from robotd.errors import ConnectError, NotReady
from robotd.motion.profile import Profile

OTHERS = [1, 2]


def assert_fault(execution: TrajectoryExecution, reason: str) -> None:
    assert execution.outcome is Outcome.FAULT
    assert reason in execution.message


def assert_works(harness: Harness) -> None:
    """Recover as an operator does, and move to the start position."""
    harness.robot.servos.enable()
    before = len(harness.setpoints.rows)
    with harness.goal(HOME, seconds=1.5) as execution:
        harness.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED, execution.message
    assert harness.image.position == pytest.approx(HOME, abs=1e-3)
    begin = harness.setpoints.rows[before]
    assert np.abs(begin[2]).max() < 0.05
    harness.setpoints.rows = harness.setpoints.rows[before:]
    harness.setpoints.assert_smooth(ACCELERATION)


def test_an_alarm_of_one_axis_stops_the_others_along_the_path(harness: Harness) -> None:
    with harness.goal(FAR) as execution:
        harness.run(0.41)
        harness.faults.trip(0, 16)
        harness.end(execution)
        rows = len(harness.setpoints.rows)
        harness.run(0.1)
        assert len(harness.setpoints.rows) == rows, "nothing is streamed after a fault"
    assert_fault(execution, "joint1 at 0.4")
    assert execution.message.endswith("amplifier alarm 16 (error 0x0010)")
    harness.setpoints.assert_smooth(ACCELERATION)
    position = harness.setpoints.position
    assert np.abs(position[:, 1] / FAR[1] - position[:, 2] / FAR[2]).max() < 1e-9
    assert harness.image.position[OTHERS] == pytest.approx(position[-1, OTHERS], abs=1e-3)
    assert_works(harness)


def test_a_servo_that_is_switched_off_is_a_fault(harness: Harness) -> None:
    with harness.goal(FAR) as execution:
        harness.run(0.41)
        harness.robot.axes.servo(1, False)
        harness.end(execution)
    assert_fault(execution, "joint2 at 0.4")
    assert execution.message.endswith("servo went off")
    assert_works(harness)


def test_a_fault_of_a_waiting_goal_is_before_its_start(harness: Harness) -> None:
    with harness.goal(FAR, start_in_s=1.0) as execution:
        harness.run(0.41)
        harness.robot.axes.servo(1, False)
        harness.end(execution)
    assert execution.outcome is Outcome.FAULT
    assert re.search(r"joint2 0\.5\d+ s before the start: servo went off$", execution.message)


def test_a_servo_cannot_be_switched_on_under_a_running_goal(harness: Harness) -> None:
    with harness.goal(FAR) as execution:
        harness.run(0.4)
        harness.robot.axes.servo(1, True)  # it is on: no effect
        harness.robot.axes.servo(1, False)
        with pytest.raises(NotReady, match="joint2: in use by trajectory"):
            harness.robot.axes.servo(1, True)
        harness.end(execution)
    assert_works(harness)


def test_a_drive_that_is_lost_is_a_fault_until_it_is_back(harness: Harness) -> None:
    with harness.goal(FAR) as execution:
        harness.run(0.41)
        harness.faults.disconnect(2)
        harness.end(execution)
    assert_fault(execution, "joint3 at 0.4")
    assert execution.message.endswith(
        "drive is offline (slave 2 does not answer: cable or power supply)"
    )
    with pytest.raises(NotReady, match="joint3: drive is offline"), harness.goal(HOME):
        pass
    harness.faults.reconnect(2)
    harness.robot.fieldbus.start_hot_connect(0)
    harness.run(0.5)
    assert_works(harness)


@pytest.mark.parametrize("how", ["stop", "quick_stop"])
def test_a_stop_by_another_command_ends_the_goal_and_all_joints(harness: Harness, how: str) -> None:
    with harness.goal(FAR) as execution:
        harness.run(0.41)
        getattr(harness.robot.axes, how)([0])
        harness.end(execution)
    assert_fault(execution, "joint1 at 0.4")
    assert execution.message.endswith("stopped by the device or another command")
    assert np.abs(harness.image.velocity).max() < 0.01
    assert harness.image.position[2] < 0.8 * FAR[2]
    with harness.goal(HOME, seconds=1.5) as execution:
        harness.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED, "no recovery is needed: the servos are on"


def test_a_control_loop_stall_is_named_as_the_reason(harness: Harness) -> None:
    with harness.goal(FAR) as execution:
        harness.run(0.4)
        harness.stall(0.3)
        harness.end(execution)
    assert_fault(execution, "joint1 at 0.")
    assert execution.message.endswith(
        "stopped by the device after a control-loop stall of 302 ms (setpoints stayed away)"
    )
    assert_works(harness)


@pytest.mark.parametrize(
    ("array", "value", "reason"),
    [
        ("amp_alarm", True, "amplifier alarm 33"),
        ("servo_on", False, "servo went off"),
        ("offline", True, "drive is offline"),
        ("operation", Operation.IDLE, "stopped by the device or another command"),
    ],
)
def test_each_sign_of_a_fault_is_enough(
    harness: Harness, array: str, value: Any, reason: str
) -> None:
    """Each sign alone, without the others that a real device would show."""
    driver = harness.robot.control_loop._driver
    read, broken = driver.read, False

    def spoiled(image: ProcessImage) -> None:
        read(image)
        if broken:
            getattr(image, array)[1] = value
            image.alarm_code[1] = 33

    driver.read = spoiled  # type: ignore[method-assign]
    with harness.goal(FAR) as execution:
        harness.run(0.41)
        broken = True
        harness.end(execution)
        broken = False
    assert_fault(execution, "joint2 at 0.4")
    assert execution.message.endswith(reason)
    harness.setpoints.assert_smooth(ACCELERATION)


def test_a_goal_after_a_stopped_one_claims_the_axes_again(harness: Harness) -> None:
    with harness.goal(FAR) as first:
        harness.run(0.4)
        harness.robot.axes.stop([0, 1, 2])
        harness.run(2 * PERIOD_S)
        with harness.goal(HOME, seconds=1.5) as second:  # while the first one still ends
            assert first.outcome is Outcome.FAULT
            harness.end(second)
    assert second.outcome is Outcome.SUCCEEDED, second.message


def test_a_fault_during_a_cancel_is_reported(harness: Harness) -> None:
    with harness.goal(FAR) as execution:
        harness.run(0.5)
        execution.cancel()
        harness.run(0.02)
        harness.faults.trip(2, 5)
        harness.end(execution)
    assert_fault(
        execution, "amplifier alarm 5 (error 0x0005) (while stopping: canceled by the client)"
    )
    assert_works(harness)


def test_a_fault_at_the_end_of_the_path_is_no_success(harness: Harness) -> None:
    with harness.goal(FAR) as execution:
        harness.run(1.002)
        harness.faults.trip(2, 5)
        harness.end(execution)
    assert_fault(execution, "joint3 at 1.000 s: amplifier alarm 5")


def test_a_goal_with_a_future_start_monitors_its_drives(harness: Harness) -> None:
    with harness.goal(FAR, start_in_s=5.0) as execution:
        harness.run(0.1)
        harness.faults.trip(0, 7)
        harness.run(0.1)
        assert_fault(execution, "amplifier alarm 7")


def test_a_lost_communication_ends_the_running_and_the_waiting_goal(harness: Harness) -> None:
    with harness.goal(FAR) as first:
        harness.run(0.4)
        with harness.goal(HOME, start_in_s=0.5) as waiting:
            harness.faults.drop_communication()
            harness.run(PERIOD_S)
            for execution in (first, waiting):
                assert_fault(execution, "communication has ended (engine state Running)")
    assert not harness.connection.ready
    assert np.isnan(harness.image.position).all()
    assert harness.image.offline.all()
    with (
        pytest.raises(NotReady, match=r"engine is not ready \(state Running\)"),
        harness.goal(HOME),
    ):
        pass
    harness.connection.start_communication()
    with pytest.raises(NotReady, match="joint1: servo is off"), harness.goal(HOME):
        harness.run(PERIOD_S)
    assert_works(harness)


def test_communication_that_is_lost_and_back_between_two_periods_ends_a_goal(
    harness: Harness,
) -> None:
    with harness.goal(FAR) as execution:
        harness.run(0.4)
        rows = len(harness.setpoints.rows)
        harness.clock.detach()
        harness.faults.drop_communication()
        harness.connection.start_communication()
        loop = harness.robot.control_loop
        harness.clock.attach(loop.period_ns, loop.period)
        harness.run(0.1)
        assert len(harness.setpoints.rows) == rows, "nothing is streamed after a loss"
        assert_fault(execution, "communication has ended, and has begun anew")
    assert_works(harness)


def test_the_device_adds_the_reason_of_the_lost_communication(harness: Harness) -> None:
    asked: list[int] = []
    harness.connection._driver.fault = lambda: asked.append(0) or "somebody pulled the plug"  # type: ignore[method-assign]
    with harness.goal(FAR) as execution:
        harness.run(0.2)
        harness.faults.drop_communication()
        harness.run(0.1)
    assert_fault(
        execution, "communication has ended (engine state Running): somebody pulled the plug"
    )
    assert len(asked) == 1, "the device is not asked again in every period"


def test_nothing_can_be_commanded_before_the_first_image(harness: Harness) -> None:
    harness.faults.drop_communication()
    harness.run(PERIOD_S)
    harness.clock.detach()
    harness.connection.start_communication()
    assert harness.connection.ready
    with pytest.raises(NotReady, match="joint1: drive is offline"), harness.goal(HOME):
        pass
    harness.clock.attach(harness.robot.control_loop.period_ns, harness.robot.control_loop.period)


@pytest.mark.parametrize("restart", ["communication", "device"])
def test_the_engine_is_stopped_and_started_under_a_goal(harness: Harness, restart: str) -> None:
    with harness.goal(FAR) as execution:
        harness.run(0.4)
        if restart == "device":
            harness.connection.close()
        else:
            harness.connection.stop_communication()
    assert execution.outcome is Outcome.CANCELED
    harness.setpoints.assert_smooth(ACCELERATION)
    assert not harness.simulation.states.servo_on.any()
    harness.connection.open()
    harness.connection.start_communication()
    harness.run(PERIOD_S)
    assert not harness.image.servo_on.any(), "nothing switches on by itself"
    assert_works(harness)


@pytest.fixture
def frozen(harness: Harness, monkeypatch: pytest.MonkeyPatch) -> Harness:
    """0.4 s into a trajectory the values stop changing, without a change of state."""
    read = harness.robot.control_loop._driver.read

    def stale(image: object) -> None:
        fresh_ns = harness.image.fresh_ns
        read(harness.image)
        harness.image.fresh_ns = fresh_ns

    harness.freeze = lambda: setattr(harness.robot.control_loop._driver, "read", stale)  # type: ignore[attr-defined]
    harness.thaw = lambda: setattr(harness.robot.control_loop._driver, "read", read)  # type: ignore[attr-defined]
    return harness


def test_old_values_end_the_goal_and_readiness(frozen: Harness) -> None:
    harness, heard = frozen, []
    harness.connection.on_ready(heard.append)
    with harness.goal(FAR) as execution:
        harness.run(0.4)
        harness.freeze()  # type: ignore[attr-defined]
        harness.run(0.098)
        assert not execution.done
        harness.run(0.006)
        assert_fault(execution, "the fieldbus values are 102 ms old")
        assert harness.connection.state is ConnectionState.UNKNOWN
        with pytest.raises(NotReady, match=r"engine is not ready \(state Unknown\)"):
            harness.robot.axes.servo(0, True)
        rows = len(harness.setpoints.rows)
        harness.run(0.5)
        assert len(harness.setpoints.rows) == rows, "nothing is streamed blindly"
    harness.thaw()  # type: ignore[attr-defined]
    harness.run(PERIOD_S)
    assert harness.connection.ready
    assert heard == [True, False, True]
    assert_works(harness)


@pytest.mark.parametrize("seen", [True, False])
def test_old_values_end_what_the_device_moves_by_itself(harness: Harness, seen: bool) -> None:
    """Nobody sees how far it goes: the soft limits neither."""
    axes = harness.robot.axes
    axes.set_command_mode(1, CommandMode.VELOCITY)
    harness.faults.freeze(not seen)
    axes.jog([Jog(1, Profile(1.0, 5.0, 5.0))])
    axes.move([Move(2, 2.0, Profile(1.0, 5.0, 5.0))])
    harness.run(0.05)
    harness.faults.freeze(True)
    harness.run(0.6)
    assert not harness.connection.ready
    at_rest = [harness.faults.position(axis) for axis in (1, 2)]
    assert 0.0 < max(at_rest) < 0.4
    harness.run(0.5)
    assert [harness.faults.position(axis) for axis in (1, 2)] == pytest.approx(at_rest, abs=1e-3)
    harness.faults.freeze(False)
    harness.run(0.1)
    assert harness.image.operation.tolist() == [Operation.IDLE] * 3


def test_a_stop_reaches_a_device_whose_values_are_old(harness: Harness) -> None:
    axes, stopped = harness.robot.axes, []
    axes.move([Move(1, 2.5, Profile(1.0, 5.0, 5.0))])
    harness.run(0.5)
    harness.robot.axes._driver.stop = stopped.append  # type: ignore[method-assign]
    harness.faults.freeze(True)
    harness.run(0.5)
    assert not harness.connection.ready
    axes.stop([1])
    assert stopped[0] == [0, 1, 2]  # repeated, as no value shows it at rest
    assert stopped[-1] == [1]


def test_a_stop_before_the_image_shows_the_claim_ends_a_stream(harness: Harness) -> None:
    driver = harness.robot.axes._driver
    begin_stream = driver.begin_stream

    def stopped(axes: Sequence[int]) -> None:
        begin_stream(axes)
        harness.robot.axes.stop([0])  # of another client

    driver.begin_stream = stopped  # type: ignore[method-assign]
    with harness.robot.stream() as stream:
        stream.send_velocity([0.1] * 3)
        harness.run(0.2)
        assert not stream.open
        assert "stopped by the device or another command" in stream.message
    assert harness.image.position == pytest.approx([0.0] * 3, abs=0.02)


def test_a_failing_read_is_tolerated_until_the_values_are_stale(harness: Harness) -> None:
    driver = harness.robot.control_loop._driver
    read = driver.read

    def fail(image: object) -> None:
        raise OSError("no frame")

    with harness.goal(FAR) as execution:
        harness.run(0.3)
        driver.read = fail  # type: ignore[method-assign]
        harness.run(0.05)
        driver.read = read  # type: ignore[method-assign]
        harness.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED
    harness.setpoints.assert_smooth(ACCELERATION)
    with harness.goal(HOME) as execution:
        harness.run(0.3)
        driver.read = fail  # type: ignore[method-assign]
        harness.run(0.2)
        assert_fault(execution, "OSError: no frame")
    driver.read = read  # type: ignore[method-assign]
    harness.run(0.5)
    assert_works(harness)


def test_a_driver_that_cannot_stream_ends_the_goal_not_the_control_loop(harness: Harness) -> None:
    driver = harness.mixer._driver
    stream = driver.stream

    def fail(position: object, velocity: object, due_ns: int) -> None:
        raise OSError("bus off")

    with harness.goal(FAR) as execution:
        harness.run(0.3)
        driver.stream = fail  # type: ignore[method-assign]
        harness.run(2 * PERIOD_S)
        assert_fault(execution, "OSError: bus off")
    driver.stream = stream  # type: ignore[method-assign]
    harness.run(0.5)
    assert_works(harness)


def test_recovery_names_every_joint_whose_servo_stays_off(harness: Harness) -> None:
    for axis in (0, 2):
        harness.faults.disconnect(axis)
    harness.run(PERIOD_S)
    with pytest.raises(ConnectError) as caught:
        harness.robot.servos.enable()
    assert list(caught.value.failures) == ["arm → joint1", "arm → joint3"]
    assert all("offline" in reason for reason in caught.value.failures.values())
    assert harness.image.servo_on.tolist() == [False, True, False]


def test_recovery_works_right_after_an_alarm() -> None:
    """Also where the image lags behind the drives and still shows the alarm."""
    harness = Harness(arm(cycle={"rate_hz": 50.0, "realtime_priority": 0})).up()
    for axis in range(3):
        harness.faults.trip(axis, 9)
    harness.run(0.02)
    assert harness.image.amp_alarm.all()
    harness.robot.servos.enable()
    assert harness.image.servo_on.all()
    assert not harness.image.amp_alarm.any()
