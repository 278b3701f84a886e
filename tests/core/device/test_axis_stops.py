"""Stops of axes are repeated until the image shows rest."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from tests.core.device.harness import PROFILE, Harness

from robotd.device.axes import Jog, Move
from robotd.device.axis_stops import ABANDONED_RETRY_S, QUICK_AFTER
from robotd.device.state import CommandMode, ConnectionState, Operation
from robotd.errors import AbandonedCall, DeviceTimeout, NotReady, OperationError, RobotdError
from robotd.motion.profile import Profile


class Busy:
    """Driver's stop that says busy ``times`` times, by an ``error``, before it obeys."""

    def __init__(
        self,
        harness: Harness,
        times: int,
        name: str = "stop",
        error: type[RobotdError] = OperationError,
    ) -> None:
        self.left, self.calls, self._obey = times, 0, getattr(harness.driver, name)
        self._error = error
        setattr(harness.driver, name, self)

    def __call__(self, axes: Sequence[int], *rest: float) -> None:
        self.calls += 1
        if self.left:
            self.left -= 1
            raise self._error("busy")
        self._obey(axes, *rest)


def run(harness: Harness, seconds: float) -> None:
    for _ in range(round(seconds / 0.002)):
        harness.refresh()


def moving(harness: Harness, axis: int, operation: Operation = Operation.POSITION) -> None:
    harness.driver.image.operation[axis] = operation
    harness.refresh()


@pytest.mark.parametrize("operation", [Operation.POSITION, Operation.VELOCITY, Operation.STREAM])
@pytest.mark.parametrize("error", [OperationError, DeviceTimeout])
def test_a_stop_that_the_control_loop_asks_for_is_repeated(
    harness: Harness, operation: Operation, error: type[RobotdError]
) -> None:
    busy = Busy(harness, 2, error=error)
    moving(harness, 1, operation)
    harness.axes.stops.request([1])
    assert harness.driver.image.operation[1] == operation
    run(harness, 1.0)
    assert harness.driver.image.operation[1] == Operation.IDLE
    assert not harness.axes.stops.pending
    assert busy.calls == 3


def test_a_stop_whose_call_does_not_return_is_called_less_often(harness: Harness) -> None:
    busy = Busy(harness, 1, error=AbandonedCall)
    moving(harness, 1)
    harness.axes.stops.request([1])
    run(harness, ABANDONED_RETRY_S - 1.0)
    assert busy.calls == 1
    run(harness, 2.0)
    assert harness.driver.image.operation[1] == Operation.IDLE


def test_a_stop_of_a_client_goes_on_although_it_was_told_of_the_failure(harness: Harness) -> None:
    Busy(harness, 1)
    moving(harness, 0)
    with pytest.raises(OperationError, match="busy"):
        harness.axes.stop([0])
    assert harness.axes.stops.pending
    run(harness, 1.0)
    assert harness.driver.image.operation[0] == Operation.IDLE
    assert not harness.axes.stops.pending


def test_a_stop_that_fails_again_and_again_becomes_a_quick_stop(harness: Harness) -> None:
    busy = Busy(harness, 1000)
    moving(harness, 0)
    harness.axes.stops.request([0])
    run(harness, 3.0)
    assert busy.calls == QUICK_AFTER
    assert ("quick_stop", [0]) in harness.driver.calls
    assert harness.driver.image.operation[0] == Operation.IDLE


def test_a_stop_without_an_effect_is_repeated(harness: Harness) -> None:
    calls: list[Sequence[int]] = []
    harness.driver.stop = calls.append  # type: ignore[method-assign]
    moving(harness, 0)
    harness.axes.stop([0])
    run(harness, 3.0)
    assert len(calls) > 1
    assert ("quick_stop", [0]) in harness.driver.calls


def test_an_axis_that_slows_down_is_left_to_its_ramp(harness: Harness) -> None:
    calls: list[Sequence[int]] = []
    harness.driver.stop = calls.append  # type: ignore[method-assign]
    moving(harness, 0, Operation.STOPPING)
    harness.driver.image.velocity[0] = velocity = 2.0
    harness.axes.stop([0])
    for _ in range(10):  # ten seconds, beyond the time of an orderly end
        velocity *= 0.8
        harness.driver.image.velocity[0] = velocity
        run(harness, 1.0)
    assert len(calls) == 1
    harness.driver.image.velocity[0] = 0.5
    run(harness, 4.0)
    assert ("quick_stop", [0]) in harness.driver.calls


def test_the_stop_of_one_axis_does_not_fail_by_another(harness: Harness) -> None:
    stop = harness.driver.quick_stop

    def fail(axes: Sequence[int]) -> None:
        if 1 in axes:
            raise OperationError("bus off")
        stop(axes)

    harness.driver.stop = harness.driver.quick_stop = fail  # type: ignore[method-assign]
    for axis in range(3):
        moving(harness, axis)
    harness.axes.stops.request([0, 1, 2])
    run(harness, 3.0)
    assert [int(operation) for operation in harness.driver.image.operation] == [
        0,
        Operation.POSITION,
        0,
    ]
    assert dict(harness.axes.stops.unconfirmed()) == {1: "bus off"}


def test_no_motion_begins_on_an_axis_whose_stop_failed(harness: Harness) -> None:
    Busy(harness, 1000)
    harness.driver.quick_stop = harness.driver.stop  # type: ignore[method-assign]
    moving(harness, 0)
    harness.axes.stops.request([0])
    with pytest.raises(NotReady, match=r"joint1: its stop is not confirmed \(busy\)"):
        harness.axes.move([Move(0, 0.5, PROFILE)])
    with pytest.raises(NotReady, match="joint1: its stop is not confirmed"):
        harness.axes.claimed("client", [0]).__enter__()
    harness.axes.move([Move(1, 0.5, PROFILE)])
    assert harness.driver.calls[-1][0] == "move"


def test_a_new_move_supersedes_a_stop_that_was_taken(harness: Harness) -> None:
    moving(harness, 0)
    harness.driver.stop = lambda axes: None  # type: ignore[method-assign]
    harness.axes.stop([0])
    moving(harness, 0, Operation.STOPPING)
    harness.axes.move([Move(0, 0.5, PROFILE)])
    run(harness, 1.0)
    assert harness.driver.image.operation[0] == Operation.POSITION
    assert not harness.axes.stops.pending


def test_rest_before_a_failed_stop_can_have_shown_proves_nothing(harness: Harness) -> None:
    """The device begins a motion that it had accepted after the stop has failed."""
    Busy(harness, 1)
    harness.axes.stops.request([0])
    harness.refresh()
    assert harness.axes.stops.pending
    moving(harness, 0)
    run(harness, 1.0)
    assert harness.driver.image.operation[0] == Operation.IDLE


def test_a_stop_is_repeated_while_no_values_come(harness: Harness) -> None:
    calls: list[Sequence[int]] = []
    harness.driver.stop = calls.append  # type: ignore[method-assign]
    moving(harness, 0)
    harness.axes.stops.request([0])
    for _ in range(30):
        harness.clock.advance(0.1)
        harness.axes.stops.look(harness.image)
    assert 3 <= len(calls) <= 8  # at a bounded rate
    assert harness.axes.stops.pending


def test_a_drive_that_does_not_answer_is_stopped_when_it_is_back(harness: Harness) -> None:
    harness.driver.image.offline[0] = True
    moving(harness, 0)
    calls: list[Sequence[int]] = []
    harness.driver.stop = calls.append  # type: ignore[method-assign]
    harness.axes.stops.request([0])
    run(harness, 0.2)
    assert not harness.axes.stops.pending  # others may go on: it is offline
    harness.driver.image.offline[0] = False
    run(harness, 3.0)
    assert ("quick_stop", [0]) in harness.driver.calls
    assert harness.driver.image.operation[0] == Operation.IDLE


def test_a_stop_that_fails_in_a_clean_up_does_not_hide_the_first_error(harness: Harness) -> None:
    harness.driver.failures |= {"stop": OperationError("busy")}
    begin = harness.driver.move

    def fail(axis: int, target: float, profile: Profile) -> None:
        if axis == 1:
            raise OperationError("drive is hot")
        begin(axis, target, profile)

    harness.driver.move = fail  # type: ignore[method-assign]
    with pytest.raises(OperationError, match="joint2: drive is hot"):
        harness.axes.move([Move(0, 0.5, PROFILE), Move(1, 0.5, PROFILE)])
    del harness.driver.failures["stop"]
    run(harness, 1.0)
    assert harness.driver.image.operation[0] == Operation.IDLE


def test_a_stream_that_cannot_be_ended_is_stopped(harness: Harness) -> None:
    harness.driver.failures["end_stream"] = OperationError("busy")
    with harness.axes.claimed("client", [0, 1]):
        harness.refresh()
    run(harness, 0.5)
    assert harness.driver.image.operation.tolist() == [Operation.IDLE] * 3


def lose_values(harness: Harness) -> None:
    harness.clock.on_sleep = None
    harness.connection.set_stale(True, "no frame")


def test_a_servo_goes_off_while_values_are_stale_and_says_what_is_not_known(
    harness: Harness,
) -> None:
    lose_values(harness)
    with pytest.raises(NotReady, match="joint2: servo off was sent and is not confirmed"):
        harness.axes.servo(1, False)
    assert not harness.driver.image.servo_on[1]
    with pytest.raises(NotReady, match="Unknown"):
        harness.axes.servo(1, True)
    assert not harness.driver.image.servo_on[1]


def test_a_servo_goes_off_before_communication_is_complete(harness: Harness) -> None:
    harness.connection.established = False
    harness.connection.update_ready()
    with pytest.raises(NotReady, match="joint1: servo off was sent and is not confirmed"):
        harness.axes.servo(0, False)
    assert not harness.driver.image.servo_on[0]


def test_a_servo_that_stays_on_is_said(harness: Harness) -> None:
    harness.driver.servo = lambda *_: None  # type: ignore[method-assign]
    with pytest.raises(NotReady, match=r"joint1: .* not confirmed: the drive reports it on"):
        harness.axes.servo(0, False)


def test_all_servos_go_off_although_one_does_not_answer(harness: Harness) -> None:
    off = harness.driver.servo

    def fail(axis: int, on: bool, timeout_s: float) -> None:
        if axis == 0:
            raise OperationError("no answer")
        off(axis, on, timeout_s)

    harness.driver.servo = fail  # type: ignore[method-assign]
    results = harness.axes.servos_off([0, 1, 2])
    assert str(results[0]) == "joint1: no answer"
    assert results[1] is results[2] is None
    assert harness.driver.image.servo_on.tolist() == [True, False, False]


def test_a_servo_that_is_switched_off_while_it_enables_stays_off(harness: Harness) -> None:
    switch = harness.driver.servo
    harness.axes.servo(0, False)

    def off_meanwhile(axis: int, on: bool, timeout_s: float) -> None:
        harness.driver.servo = switch  # type: ignore[method-assign]
        harness.axes.servo(0, False)
        switch(axis, on, timeout_s)  # the drive enables late

    harness.driver.servo = off_meanwhile  # type: ignore[method-assign]
    with pytest.raises(NotReady, match="joint1: its servo was switched off meanwhile"):
        harness.axes.servo(0, True)
    assert not harness.driver.image.servo_on[0]


@pytest.mark.parametrize("quick", [False, True])
def test_stops_reach_a_device_that_is_not_established(harness: Harness, quick: bool) -> None:
    harness.connection.established = False
    harness.connection.update_ready()
    (harness.axes.quick_stop if quick else harness.axes.stop)([0])
    assert harness.driver.calls[-1] == ("quick_stop" if quick else "stop", [0])
    harness.device.current = ConnectionState.RUNNING
    harness.axes.stop([1])
    assert harness.driver.calls[-1][1] == [0]


def test_a_velocity_of_zero_stops_while_values_are_stale(harness: Harness) -> None:
    harness.driver.image.mode[0] = CommandMode.VELOCITY
    moving(harness, 0, Operation.VELOCITY)
    lose_values(harness)
    with pytest.raises(NotReady):
        harness.axes.jog([Jog(0, Profile(0.0, 5.0, 5.0))])
    assert harness.driver.image.operation[0] == Operation.IDLE
