"""Stop of all motion on the simulation: controlled, latched, and covering every command."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pytest
from structlog.testing import capture_logs
from tests.core.control.harness import ACCELERATION, RATE_HZ, Harness, arm

from robotd.control.loop.setpoint_source import Outcome
from robotd.device.axes import Axes, Jog, Move
from robotd.device.process_image import ProcessImage
from robotd.device.state import CommandMode, Operation
from robotd.errors import DeviceTimeout, NotReady, OperationError
from robotd.motion.profile import Profile

FAR = (1.0, -0.6, 0.3)
CAUSE = "motion is stopped: by the operator"
STOPPED = f"{CAUSE}; robotd reset allows it again"
SWITCH = {"input_byte": 0, "input_bit": 3}


def test_a_goal_stops_on_its_path_and_the_next_one_is_rejected(harness: Harness) -> None:
    with harness.goal(FAR) as execution:
        harness.run(0.4)
        harness.robot.stop()
        assert (execution.outcome, execution.message) == (
            Outcome.STOPPED,
            "stopped: by the operator",
        )
    harness.setpoints.assert_smooth(ACCELERATION)
    ratio = harness.setpoints.position[-1] / np.array(FAR)
    assert ratio == pytest.approx(ratio[0])  # on the straight line to the goal
    assert 0.1 < ratio[0] < 0.9
    with pytest.raises(NotReady, match=STOPPED), harness.goal(FAR):
        pass
    assert harness.robot.problems == [CAUSE]


def test_a_stop_ends_streams_of_ended_sources_in_the_device(harness: Harness) -> None:
    """Their client may keep the axes, and a device may have setpoints left."""
    with harness.goal(FAR) as execution:
        harness.until(lambda: execution.done)
        assert (harness.robot.image.operation == Operation.STREAM).all()
        harness.robot.stop()
        assert (harness.robot.image.operation == Operation.IDLE).all()


def test_a_stop_whose_end_no_value_shows_says_so(harness: Harness) -> None:
    """A goal ends with the device, while its axes still slow down."""
    with harness.goal(FAR) as execution:
        harness.run(0.4)
        harness.faults.freeze(True)
        for _ in range(2):  # while the device is being lost, and afterwards
            with pytest.raises(NotReady, match="nothing shows whether the axes are at rest"):
                harness.robot.stop()
        assert execution.done


def test_a_stop_before_the_device_was_started_ends_at_once() -> None:
    robot = Harness().robot
    robot.stop()
    assert robot.axes.stop_latch.reason


def test_motion_is_allowed_again_by_a_reset_and_nothing_moves_by_it(harness: Harness) -> None:
    with harness.goal(FAR):
        harness.run(0.4)
        harness.robot.stop()
    position = harness.image.position_command.copy()
    assert harness.robot.reset() == "motion is allowed again; it was stopped: by the operator"
    harness.run(0.5)
    assert (harness.image.position_command == position).all()
    with harness.goal(FAR) as execution:
        assert harness.end(execution).outcome is Outcome.SUCCEEDED


def test_a_reset_without_a_stop_says_so(harness: Harness) -> None:
    assert harness.robot.reset() == "motion was not stopped"


def test_a_reset_while_paused_allows_no_motion(harness: Harness) -> None:
    harness.up()
    harness.robot.pause()
    harness.robot.stop("by the operator")
    assert harness.robot.reset() == (
        "the stop is over; it was: by the operator; motion is paused; robotd resume allows it again"
    )


def test_the_first_reason_stays(harness: Harness) -> None:
    harness.robot.stop("by the first")
    harness.robot.stop("by the second")
    assert harness.robot.reset().endswith("by the first")


def test_a_goal_that_waits_for_its_start_and_its_predecessor_are_stopped(harness: Harness) -> None:
    with harness.goal(FAR) as running, harness.goal((0.0, 0.0, 0.0), start_in_s=0.8) as waiting:
        harness.run(0.4)
        harness.robot.stop()
        assert (running.outcome, waiting.outcome) == (Outcome.STOPPED, Outcome.STOPPED)


def test_a_goal_that_is_submitted_meanwhile_is_stopped_before_it_moves(harness: Harness) -> None:
    harness.robot.axes.stop_latch.check = lambda: None  # type: ignore[method-assign]
    harness.robot.axes.stop_latch.engage("by the operator")
    with harness.goal(FAR) as execution:
        harness.end(execution)
    assert execution.outcome is Outcome.STOPPED
    assert np.abs(harness.image.position_command).max() < 1e-3


def test_moves_and_jogs_of_single_axes_are_stopped_and_rejected() -> None:
    harness = Harness(arm(axes=4)).up()
    axes = harness.robot.axes
    axes.servo(3, True)
    axes.set_command_mode(3, CommandMode.VELOCITY)
    jog, move = Jog(3, Profile(1.0, 5.0, 5.0)), Move(0, 2.0, Profile(1.0, 5.0, 5.0))
    axes.jog([jog])
    axes.move([move])
    harness.run(0.5)
    assert np.abs(harness.image.velocity[[0, 3]]).min() > 0.5
    harness.robot.stop()
    assert np.abs(harness.image.velocity).max() < 0.02
    assert harness.image.servo_on.all()
    for command in (lambda: axes.jog([jog]), lambda: axes.move([move]), lambda: axes.home(1)):
        with pytest.raises(NotReady, match=STOPPED):
            command()
    harness.robot.reset()
    axes.move([move])


def test_servos_can_be_switched_and_faults_recovered_while_stopped(harness: Harness) -> None:
    harness.robot.stop()
    harness.robot.axes.servo(1, False)
    lines: list[str] = []
    harness.robot.recover(lines.append)
    assert harness.image.servo_on.all()
    assert lines[-1] == STOPPED


def test_a_ramp_that_is_too_gentle_is_followed_by_a_quick_stop() -> None:
    harness = Harness(arm(axes=4, engine={"shutdown_s": 0.5, "servo_timeout_s": 0.5})).up()
    axes = harness.robot.axes
    axes.servo(3, True)
    axes.set_command_mode(3, CommandMode.VELOCITY)
    axes.jog([Jog(3, Profile(1.0, 5.0, 1e-6))])
    harness.run(0.5)
    harness.robot.stop()
    assert abs(harness.image.velocity[3]) < 0.1


def test_a_reset_waits_for_standstill() -> None:
    harness = Harness(arm(axes=4, engine={"shutdown_s": 0.5, "servo_timeout_s": 0.5})).up()
    axes = harness.robot.axes
    axes.servo(3, True)
    axes.set_command_mode(3, CommandMode.VELOCITY)
    axes.jog([Jog(3, Profile(1.0, 5.0, 1e-6))])
    harness.run(0.1)
    axes.stop_latch.engage("by a message")
    with pytest.raises(DeviceTimeout, match=r"axes still move after 0\.5 s"):
        harness.robot.reset()
    assert axes.stop_latch.reason


def test_a_move_that_begins_after_its_time_out_is_stopped(harness: Harness) -> None:
    driver = harness.robot.axes._driver
    move = driver.move

    def hang(*_: object) -> None:
        raise DeviceTimeout("no answer")

    driver.move = hang  # type: ignore[method-assign]
    with pytest.raises(DeviceTimeout):
        harness.move(0, 2.0)
    driver.move = move  # type: ignore[method-assign]
    harness.run(0.1)
    driver.move(0, 2.0, Profile(1.0, 5.0, 5.0))  # the abandoned call goes on
    harness.run(0.5)
    assert harness.image.operation[0] == Operation.IDLE
    assert harness.image.position[0] < 0.01
    harness.move(0, 0.5)
    harness.run(1.5)
    assert harness.image.position[0] == pytest.approx(0.5, abs=1e-3)


def test_a_homing_that_goes_on_after_its_time_out_is_stopped(harness: Harness) -> None:
    driver, operations = harness.robot.axes._driver, harness.simulation.states.operation
    home = driver.home

    def hang(*_: object) -> None:
        raise DeviceTimeout("no answer")

    driver.home = hang  # type: ignore[method-assign]
    with pytest.raises(DeviceTimeout):
        harness.robot.axes.home(0)
    driver.home = home  # type: ignore[method-assign]
    operations[0] = Operation.HOMING  # it searches a switch
    harness.run(0.1)
    assert harness.axes_in(Operation.HOMING) == []
    harness.robot.axes.home(0)


def test_a_trajectory_that_the_device_begins_after_its_time_out_is_stopped(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with monkeypatch.context() as on_device:
        on_device.setattr(Axes, "trajectories_on_device", True)
        harness = Harness().up()
        driver = harness.robot.axes._driver

        def hang(*_: object) -> None:
            raise DeviceTimeout("no answer")

        driver.follow = hang  # type: ignore[method-assign]
        with harness.goal(FAR) as execution:
            harness.end(execution)
    assert (execution.outcome, execution.message) == (Outcome.FAULT, "no answer")
    harness.run(0.1)
    driver.begin_stream([0, 1, 2])  # the abandoned call goes on
    assert harness.axes_in(Operation.STREAM) == [0, 1, 2]
    harness.run(0.1)
    assert harness.axes_in(Operation.IDLE) == [0, 1, 2]
    with harness.robot.stream() as stream:
        stream.send_velocity([0.5] * 3)
        harness.run(0.1)
        assert stream.open
        assert harness.axes_in(Operation.STREAM) == [0, 1, 2]


def test_a_stop_during_a_reset_stays_in_force(harness: Harness) -> None:
    latch = harness.robot.axes.stop_latch
    stop_while_braking(harness, lambda: latch.engage("by the second"))
    with pytest.raises(NotReady, match="motion was stopped again meanwhile"):
        harness.robot.reset()
    with pytest.raises(NotReady, match="motion is stopped: by the first"):
        harness.move(0, 0.0)
    harness.robot.reset()
    harness.move(0, 0.0)


def test_an_input_that_stops_during_a_reset_stays_in_force() -> None:
    harness = Harness(arm(stop_input=SWITCH | {"motion_level": 0})).up()
    stop_while_braking(harness, lambda: harness.faults.set_input_bit(0, 3, True))
    with pytest.raises(NotReady, match=r"stop input 0\.3 forbids motion: release it first"):
        harness.robot.reset()
    harness.faults.set_input_bit(0, 3, False)
    harness.run(0.5)
    with pytest.raises(NotReady, match="motion is stopped: by the first"):
        harness.move(0, 0.0)


def stop_while_braking(harness: Harness, stop: Callable[[], None]) -> None:
    """Stop a moving axis; ``stop`` is called when it has half of its speed."""
    harness.move(0, 2.0)
    harness.run(0.5)
    harness.robot.axes.stop_latch.engage("by the first")
    stops = [stop]

    def look(image: ProcessImage) -> None:
        if stops and np.abs(image.velocity).max() < 0.5:
            stops.pop()()

    harness.robot.control_loop.every(RATE_HZ, "second stop", look)


def test_stopped_stays_stopped_over_a_restart_of_the_device(harness: Harness) -> None:
    harness.robot.stop()
    harness.connection.stop_communication()
    harness.robot.recover()
    with pytest.raises(NotReady, match=STOPPED), harness.goal(FAR):
        pass


def test_an_input_stops_and_has_to_be_released_before_the_reset() -> None:
    harness = Harness(arm(stop_input=SWITCH))
    harness.robot.connection.open()
    harness.faults.set_input_bit(0, 3, True)
    harness.up()
    with harness.goal(FAR) as execution:
        harness.run(0.4)
        harness.faults.set_input_bit(0, 3, False)
        harness.end(execution)
    assert execution.message == "stopped: stop input 0.3 forbids motion"
    harness.setpoints.assert_smooth(ACCELERATION)
    with pytest.raises(NotReady, match=r"stop input 0\.3 forbids motion: release it first"):
        harness.robot.reset()
    harness.faults.set_input_bit(0, 3, True)
    harness.run(0.1)
    with pytest.raises(NotReady, match="motion is stopped"), harness.goal(FAR):
        pass
    harness.robot.reset()
    with harness.goal(FAR) as execution:
        assert harness.end(execution).outcome is Outcome.SUCCEEDED


def test_an_input_that_cannot_be_read_stops() -> None:
    harness = Harness(arm(stop_input=SWITCH | {"motion_level": 0})).up()
    driver = harness.robot.io._maybe_driver
    assert driver is not None
    read = driver.read_inputs

    def fail(byte: int, length: int) -> bytes:
        raise OperationError("no such module")

    with harness.goal(FAR) as execution:
        harness.run(0.4)
        driver.read_inputs = fail  # type: ignore[method-assign]
        harness.end(execution)
    reason = "stop input 0.3 cannot be read (no such module)"
    assert execution.message == f"stopped: {reason}"
    harness.setpoints.assert_smooth(ACCELERATION)
    with pytest.raises(NotReady, match=re.escape(reason)):
        harness.robot.reset()
    driver.read_inputs = read  # type: ignore[method-assign]
    harness.robot.reset()
    harness.move(0, 0.0)


def test_an_input_may_stop_at_level_1() -> None:
    harness = Harness(arm(stop_input=SWITCH | {"motion_level": 0})).up()
    harness.run(0.1)
    assert harness.robot.problems == []
    harness.faults.set_input_bit(0, 3, True)
    harness.run(0.1)
    assert "stop input 0.3 forbids motion" in harness.robot.problems[0]


def test_each_change_is_told_once(harness: Harness) -> None:
    seen: list[str] = []
    harness.robot.axes.stop_latch.on_change(seen.append)
    with capture_logs() as logs:
        harness.robot.stop()
        harness.robot.stop()
        harness.robot.reset()
    assert seen == ["", "by the operator", ""]
    assert [line["event"] for line in logs if "motion" in line["event"]] == [
        "motion stopped",
        "motion allowed again",
    ]
