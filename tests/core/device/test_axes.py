"""Axis commands: what is rejected, why, and that nothing reaches the driver then."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.core.device.harness import (
    ALL,
    ONE_AXIS,
    PROFILE,
    Command,
    Harness,
    rejected,
)
from tests.fakes import FakeAxes

from robotd.device.axes import Axes, Jog, Move, each
from robotd.device.capabilities import Capability
from robotd.device.motion_limits import MotionLimits
from robotd.device.state import CommandMode, Operation
from robotd.errors import (
    DeviceTimeout,
    InvalidArgument,
    NotReady,
    OperationError,
    Unsupported,
)
from robotd.motion.profile import Profile

UNLIMITED_AXIS = 2


def jogging(harness: Harness) -> Harness:
    harness.driver.image.mode[:] = CommandMode.VELOCITY
    harness.refresh()
    return harness


def servo_off(harness: Harness) -> Harness:
    harness.driver.image.servo_on[:] = False
    harness.refresh()
    return harness


@pytest.mark.parametrize("command", ONE_AXIS.values(), ids=ONE_AXIS)
@pytest.mark.parametrize("axis", [-1, 3])
def test_an_axis_that_is_not_there_is_rejected(
    harness: Harness, command: Command, axis: int
) -> None:
    text = rf"^axis {axis} is outside 0\.\.2$"
    rejected(harness, InvalidArgument, text, lambda: command(harness.axes, axis))


@pytest.mark.parametrize("command", ONE_AXIS.values(), ids=ONE_AXIS)
def test_nothing_is_commanded_before_the_engine_is_ready(command: Command) -> None:
    harness = Harness()
    text = r"^engine is not ready \(state Idle\)$"
    rejected(harness, NotReady, text, lambda: command(harness.axes, 0))


def test_a_servo_obeys_within_the_descriptors_time_out(harness: Harness) -> None:
    timeout_s = harness.connection.settings.servo_timeout_s
    harness.axes.servo(1, False)
    harness.axes.servo(1, True)
    assert harness.driver.calls == [("servo", 1, False, timeout_s), ("servo", 1, True, timeout_s)]


@pytest.mark.parametrize("was_on", [False, True])
def test_a_servo_that_is_not_enabled_in_time_is_not_enabled_later(
    harness: Harness, was_on: bool
) -> None:
    if not was_on:
        servo_off(harness)
    switched: list[bool] = []

    def servo(axis: int, on: bool, timeout_s: float) -> None:
        switched.append(on)
        raise DeviceTimeout("servo did not return within 7 s")  # in time; it still may

    harness.driver.servo = servo  # type: ignore[method-assign]
    with pytest.raises(DeviceTimeout, match="joint1: servo did not return within 7 s"):
        harness.axes.servo(0, True)
    assert switched == ([True] if was_on else [True, False])


def test_a_servo_in_alarm_stays_off_until_the_alarm_is_cleared(harness: Harness) -> None:
    harness.driver.image.amp_alarm[0], harness.driver.image.alarm_code[0] = True, 16
    servo_off(harness)
    text = "^joint1: amplifier alarm 16; clear it first$"
    rejected(harness, NotReady, text, lambda: harness.axes.servo(0, True))
    harness.axes.servo(0, False)
    harness.axes.clear_alarm(0)
    harness.refresh()
    harness.axes.servo(0, True)


def test_a_servo_at_an_unknown_position_stays_off(harness: Harness) -> None:
    harness.driver.image.position[0] = math.nan
    servo_off(harness)
    text = "^joint1: position is not known: the device has not reported it$"
    rejected(harness, NotReady, text, lambda: harness.axes.servo(0, True))


@pytest.mark.parametrize("mode", [-1, 3])
def test_an_unknown_mode_is_rejected(harness: Harness, mode: int) -> None:
    text = f"^joint1: mode {mode} is not 0, 1 or 2$"
    rejected(harness, InvalidArgument, text, lambda: harness.axes.set_command_mode(0, mode))


@pytest.mark.parametrize("command", ["home", "set_command_mode"])
def test_an_axis_belongs_to_its_homing_or_change_of_mode_until_it_ends(
    harness: Harness, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    """Other threads meanwhile: the image still shows an idle axis in position mode."""
    axes, texts = harness.axes, list[str]()
    others: dict[str, Callable[[], object]] = {
        "move": lambda: axes.move([Move(0, 1.0, PROFILE)]),
        "home": lambda: axes.home(0),
        "set_command_mode": lambda: axes.set_command_mode(0, CommandMode.VELOCITY),
    }

    def obey(*_: object) -> None:
        for other in others.values():
            with pytest.raises(NotReady) as error:
                other()
            texts.append(str(error.value))

    monkeypatch.setattr(harness.driver, command, obey)
    others[command]()
    owner = "homing" if command == "home" else "the command mode"
    assert texts == [f"joint1: in use by {owner}"] * 3
    assert not harness.driver.calls
    assert not axes.owner(0)


def test_a_homing_that_moves_takes_the_speed_in_force(
    harness: Harness, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that does not move is not bound by it, also while motion is paused."""
    axes, searches = harness.axes, list[tuple[object, ...]]()
    monkeypatch.setattr(harness.driver, "search_home", lambda *given: searches.append(given))
    monkeypatch.setattr(harness.driver, "homing_speed", lambda axis: 0.0 if axis == 2 else 0.4)
    axes.speed.set(0.5)
    limits = MotionLimits((0, 1))
    axes.motion_limits.append(limits)
    axes.home(0)
    limits.set_speed(lambda positions, _: np.full(len(positions), 0.25), "reduced speed", "")
    axes.home(1)
    assert [call[:2] for call in searches] == [(0, pytest.approx(0.2)), (1, pytest.approx(0.05))]
    axes.speed.pause()
    rejected(harness, NotReady, "^joint1: motion is paused; robotd resume", lambda: axes.home(0))
    assert len(searches) == 2
    axes.home(2)
    assert harness.driver.calls[-1][0] == "home"


@pytest.mark.parametrize("operation", [op for op in Operation if op is not Operation.IDLE])
def test_mode_and_home_need_an_idle_axis(harness: Harness, operation: Operation) -> None:
    harness.driver.image.operation[0] = operation
    harness.refresh()
    text = f"needs an idle axis, this one is in {operation.name.lower()}$"
    if operation is Operation.GUIDING:
        text = "joint1: in use by hand guiding$"
    rejected(harness, NotReady, text, lambda: harness.axes.set_command_mode(0, 1))
    rejected(harness, NotReady, text, lambda: harness.axes.home(0))


def test_scaling_changes_only_while_the_servo_is_off(harness: Harness) -> None:
    rejected(
        harness, NotReady, "only while the servo is off", lambda: harness.axes.set_polarity(0, 1)
    )
    rejected(
        harness,
        NotReady,
        "only while the servo is off",
        lambda: harness.axes.set_gear_ratio(0, 1, 1),
    )
    servo_off(harness)
    harness.clock.sleep_until_ns = lambda time_ns: harness.refresh()  # type: ignore[method-assign]
    harness.axes.set_polarity(0, -1)
    harness.axes.set_gear_ratio(0, 1000.0, 2.0)
    assert harness.driver.calls == [("set_polarity", 0, -1), ("set_gear_ratio", 0, 1000.0, 2.0)]


@pytest.mark.parametrize("command", ["set_polarity", "set_gear_ratio"])
def test_scaling_stays_where_a_servo_has_just_been_switched_on(
    harness: Harness, command: str
) -> None:
    servo_off(harness)
    harness.driver.image.servo_on[0] = True  # the image does not show it yet
    text = "joint1: .* can change only while the servo is off"
    harness.clock.sleep_until_ns = lambda time_ns: harness.refresh()  # type: ignore[method-assign]
    rejected(harness, NotReady, text, lambda: ONE_AXIS[command](harness.axes, 0))


@pytest.mark.parametrize("polarity", [0, 2, -2])
def test_a_polarity_that_is_none_is_rejected(harness: Harness, polarity: int) -> None:
    text = f"^joint1: polarity {polarity} is not 1 or -1$"
    rejected(
        servo_off(harness), InvalidArgument, text, lambda: harness.axes.set_polarity(0, polarity)
    )


@given(index=st.lists(st.integers(-3, 9), max_size=6))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_axis_numbers_are_in_range_and_unique_or_rejected(
    harness: Harness, index: list[int]
) -> None:
    axes = harness.axes
    if index and len(set(index)) == len(index) and set(index) <= set(range(len(axes))):
        axes.check_numbers(index)
    else:
        with pytest.raises(InvalidArgument, match="axis"):
            axes.check_numbers(index)


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf, 2.0**31])
def test_a_gear_ratio_that_is_none_is_rejected(harness: Harness, bad: float) -> None:
    servo_off(harness)
    axes = harness.axes
    rejected(
        harness,
        InvalidArgument,
        f"gear ratio numerator {bad}",
        lambda: axes.set_gear_ratio(0, bad, 1),
    )
    rejected(
        harness,
        InvalidArgument,
        f"gear ratio denominator {bad}",
        lambda: axes.set_gear_ratio(0, 1, bad),
    )


@pytest.mark.parametrize(
    ("missing", "feature", "command"),
    [
        (Capability.VELOCITY_MODE, "velocity mode", lambda axes: axes.set_command_mode(0, 1)),
        (Capability.VELOCITY_MODE, "velocity mode", lambda axes: axes.jog([Jog(0, PROFILE)])),
        (Capability.TORQUE_MODE, "torque mode", lambda axes: axes.set_command_mode(0, 2)),
        (Capability.SCALING, "polarity", lambda axes: axes.set_polarity(0, 1)),
        (Capability.SCALING, "gear ratio", lambda axes: axes.set_gear_ratio(0, 1, 1)),
        (Capability.HOMING, "homing", lambda axes: axes.home(0)),
    ],
)
def test_what_the_backend_cannot_do_is_unsupported(
    missing: Capability, feature: str, command: Callable[[Axes], Any]
) -> None:
    harness = Harness(capabilities=ALL - {missing}).make_ready()
    text = f"^{feature}: not supported by the fake backend$"
    rejected(harness, Unsupported, text, lambda: command(harness.axes))


def test_moves_start_together(harness: Harness) -> None:
    harness.axes.move([Move(1, 0.5, PROFILE), Move(0, -0.5, PROFILE)])
    assert harness.driver.calls == [("move", 1, 0.5, PROFILE), ("move", 0, -0.5, PROFILE)]


def test_a_pause_meanwhile_removes_no_limit_of_the_speed(harness: Harness) -> None:
    limits = MotionLimits([0, 1])
    limits.set_speed(lambda positions, velocities: np.array([0.25]), "reduced speed", "")
    harness.axes.motion_limits.append(limits)
    at_start = harness.axes.speed.at_start

    def paused() -> float:
        scale = at_start()
        harness.axes.speed.pause()  # by another client
        return scale

    harness.axes.speed.at_start = paused  # type: ignore[method-assign]
    harness.axes.move([Move(0, 1.0, PROFILE)])
    assert harness.driver.calls == [("move", 0, 1.0, PROFILE.scaled(0.25))]


def test_a_relative_move_counts_from_the_position_command(harness: Harness) -> None:
    harness.driver.image.position_command[0] = 1.5
    harness.driver.image.position[0] = 1.4
    harness.refresh()
    harness.axes.move([Move(0, 0.25, PROFILE)], relative=True)
    assert harness.driver.calls == [("move", 0, 1.75, PROFILE)]
    rejected(
        harness,
        InvalidArgument,
        "joint1: target 2.25",
        lambda: harness.axes.move([Move(0, 0.75, PROFILE)], relative=True),
    )


@pytest.mark.parametrize(
    ("move", "text"),
    [
        (Move(0, 2.5, PROFILE), r"^joint1: target 2\.5 rad .* 2 rad$"),
        (Move(0, -1.5, PROFILE), r"^joint1: target -1\.5 rad .* -1 rad$"),
        (Move(0, math.nan, PROFILE), "^joint1: target .*nan"),
        (Move(0, 1.0, Profile(3.5, 5.0, 5.0)), r"^joint1: velocity 3\.5 rad/s .* 3 rad/s$"),
        (Move(0, 1.0, Profile(1.0, 11.0, 5.0)), r"^joint1: acceleration 11 rad/s² .* 10 rad/s²$"),
        (Move(0, 1.0, Profile(1.0, 5.0, 11.0)), r"^joint1: deceleration 11 rad/s² .* 10 rad/s²$"),
        (Move(0, 1.0, Profile(0.0, 5.0, 5.0)), "^joint1: velocity .*positive"),
        (Move(0, 1.0, Profile(1.0, 0.0, 5.0)), "^joint1: acceleration .*positive"),
        (Move(UNLIMITED_AXIS, math.inf, PROFILE), "^axis 2: target .*inf"),
        (Move(UNLIMITED_AXIS, 1.0, Profile(-1.0, 5.0, 5.0)), "^axis 2: velocity .*positive"),
    ],
)
def test_a_bad_move_holds_back_the_good_ones_beside_it(
    harness: Harness, move: Move, text: str
) -> None:
    good = Move(1, 0.5, PROFILE)
    rejected(harness, InvalidArgument, text, lambda: harness.axes.move([good, move]))


def test_an_axis_without_limits_goes_anywhere(harness: Harness) -> None:
    far = Move(UNLIMITED_AXIS, 1e6, Profile(1e3, 1e4, 1e4))
    harness.axes.move([far])
    assert harness.driver.calls == [("move", UNLIMITED_AXIS, 1e6, far.profile)]


def test_no_axis_and_the_same_axis_twice_are_rejected(harness: Harness) -> None:
    rejected(harness, InvalidArgument, "^no axis given$", lambda: harness.axes.move([]))
    twice = [Move(1, 0.5, PROFILE), Move(1, 0.6, PROFILE)]
    rejected(harness, InvalidArgument, "^axis 1 is given twice$", lambda: harness.axes.move(twice))


@pytest.mark.parametrize("axis", [-1, 99])
def test_a_jog_of_an_axis_that_does_not_exist_is_rejected(harness: Harness, axis: int) -> None:
    call = partial(harness.axes.jog, [Jog(axis, PROFILE)])
    rejected(harness, InvalidArgument, f"axis {axis}", call)


def test_jogs_are_checked_and_start_together(harness: Harness) -> None:
    jogging(harness)
    backwards = Profile(-3.0, 10.0, 10.0)
    harness.axes.jog([Jog(0, backwards), Jog(1, Profile(0.0, 1.0, 1.0))])
    assert [call[:2] for call in harness.driver.calls] == [("jog", 0), ("jog", 1)]
    fast = [Jog(1, PROFILE), Jog(0, Profile(-3.5, 1.0, 1.0))]
    text = r"^joint1: velocity -3\.5 rad/s .* 3 rad/s$"
    rejected(harness, InvalidArgument, text, lambda: harness.axes.jog(fast))


@pytest.mark.parametrize(
    ("array", "value", "reason"),
    [
        ("offline", True, "^joint1: drive is offline$"),
        ("amp_alarm", True, "^joint1: amplifier alarm 0$"),
        ("servo_on", False, "^joint1: servo is off$"),
        ("mode", CommandMode.VELOCITY, "^joint1: in velocity mode, not in position mode$"),
    ],
)
def test_a_state_that_forbids_motion_is_named(
    harness: Harness, array: str, value: int, reason: str
) -> None:
    getattr(harness.driver.image, array)[0] = value
    harness.refresh()
    both = [Move(1, 0.5, PROFILE), Move(0, 0.5, PROFILE)]
    rejected(harness, NotReady, reason, lambda: harness.axes.move(both))


def test_a_jog_needs_velocity_mode(harness: Harness) -> None:
    text = "^joint1: in position mode, not in velocity mode$"
    rejected(harness, NotReady, text, lambda: harness.axes.jog([Jog(0, PROFILE)]))


def test_stops_have_no_effect_before_the_engine_is_ready() -> None:
    harness = Harness()
    harness.axes.stop([0])
    harness.axes.quick_stop([0])
    assert harness.driver.calls == []


def test_rest_waits_for_standstill_and_names_who_still_moves(harness: Harness) -> None:
    harness.axes.stop_and_wait([0, 1], 1.0)
    harness.driver.stop = lambda axes: None  # type: ignore[method-assign]
    harness.driver.image.operation[1] = Operation.STOPPING
    harness.refresh()
    before_ns = harness.clock.now_ns()
    with pytest.raises(DeviceTimeout, match=r"^joint2: not at rest after 1\.0 s$"):
        harness.axes.stop_and_wait([0, 1], 1.0)
    assert harness.clock.now_ns() - before_ns >= 1_000_000_000


def test_a_driver_that_fails_is_heard(harness: Harness) -> None:
    harness.driver.failures["home"] = OperationError("no index pulse")
    with pytest.raises(OperationError, match="no index pulse"):
        harness.axes.home(0)


def test_each_tries_every_axis(harness: Harness) -> None:
    harness.driver.image.amp_alarm[1] = True
    harness.refresh()
    results = each([0, 1, 2], lambda axis: harness.axes.servo(axis, True))
    assert [results[axis] is None for axis in (0, 1, 2)] == [True, False, True]
    assert isinstance(results[1], NotReady)
    assert [call[1] for call in harness.driver.calls] == [0, 2]


@pytest.mark.parametrize("given", [None, 0])
def test_an_error_of_the_driver_gets_the_name_of_its_axis_once(given: int | None) -> None:
    harness = Harness().make_ready()
    harness.driver.failures["servo"] = NotReady("the drive is in alarm 16", axis=given)
    with pytest.raises(NotReady) as caught:
        harness.axes.servo(0, True)
    assert str(caught.value) == "joint1: the drive is in alarm 16"
    assert caught.value.axis == 0


def test_an_unsupported_feature_is_not_the_fault_of_an_axis() -> None:
    harness = Harness().make_ready()
    harness.driver.failures["servo"] = Unsupported("servo", "fake")
    with pytest.raises(Unsupported, match=r"^servo: not supported by the fake backend$"):
        harness.axes.servo(0, True)


def test_axes_with_one_servo_switch_are_switched_and_checked_together(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(FakeAxes, "servo_groups", ((0, 1),))
    harness = Harness().make_ready()
    assert harness.axes.servo_group(1) == (0, 1)
    assert harness.axes.servo_group(2) == (2,)
    harness.image.servo_on[:2] = False
    harness.image.amp_alarm[1] = True
    with pytest.raises(NotReady, match=r"^joint2: amplifier alarm 0; clear it first$"):
        harness.axes.servo(0, True)
    assert not harness.driver.calls


def test_an_alarm_of_the_controller_is_not_that_of_an_axis() -> None:
    harness = Harness().make_ready()
    harness.image.set_controller_alarm(17, "emergency stop")
    text = r"^controller alarm 17 \(emergency stop\)$"
    with pytest.raises(NotReady, match=text):
        harness.axes.move([Move(0, 1.0, PROFILE)])
    assert str(harness.axes.rejection(1, CommandMode.POSITION)) == (
        "controller alarm 17 (emergency stop)"
    )


@pytest.mark.parametrize("velocity", [False, True])
def test_a_stop_while_motions_begin_stops_them_and_begins_no_other(
    harness: Harness, velocity: bool
) -> None:
    if velocity:
        jogging(harness)
    begun: list[int] = []

    def begin(axis: int, *_: object) -> None:
        harness.axes.stop([1, 2])  # of another client, while the driver writes a ramp
        begun.append(axis)

    harness.driver.move = harness.driver.jog = begin  # type: ignore[assignment,method-assign]
    jogs, moves = [Jog(1, PROFILE), Jog(2, PROFILE)], [Move(1, 0.5, PROFILE), Move(2, 0.5, PROFILE)]
    command = partial(harness.axes.jog, jogs) if velocity else partial(harness.axes.move, moves)
    with pytest.raises(NotReady, match="joint2: stopped before the motion began"):
        command()
    assert begun == [1]
    assert harness.driver.calls[-2:] == [("stop", [1, 2]), ("stop", [1])]


def test_a_motion_that_begins_after_the_latch_was_engaged_is_stopped(harness: Harness) -> None:
    def begin(*_: object) -> None:
        harness.axes.stop_latch.engage("a button")

    harness.driver.move = begin  # type: ignore[assignment,method-assign]
    with pytest.raises(NotReady, match="joint2: motion is stopped: a button"):
        harness.axes.move([Move(1, 0.5, PROFILE)])
    assert harness.driver.calls[-1] == ("stop", [1])


@pytest.mark.parametrize("velocity", [False, True])
def test_a_motion_that_cannot_begin_stops_those_that_began_with_it(
    harness: Harness, velocity: bool
) -> None:
    if velocity:
        jogging(harness)

    def begin(axis: int, *_: object) -> None:
        if axis == 2:
            raise OperationError("the drive answers error 7")

    harness.driver.move = harness.driver.jog = begin  # type: ignore[assignment,method-assign]
    jogs, moves = [Jog(1, PROFILE), Jog(2, PROFILE)], [Move(1, 0.5, PROFILE), Move(2, 0.5, PROFILE)]
    command = partial(harness.axes.jog, jogs) if velocity else partial(harness.axes.move, moves)
    with pytest.raises(OperationError, match="axis 2: the drive answers error 7"):
        command()
    assert harness.driver.calls[-1] == ("stop", [1])


def test_a_stop_while_guiding_begins_is_made_again_and_guiding_rejected(harness: Harness) -> None:
    def begin_guiding(axes: Sequence[int], timeout_s: float) -> None:
        harness.axes.stop([1])
        harness.driver.calls.append(("begin_guiding", list(axes)))
        harness.driver.image.operation[:2] = Operation.GUIDING
        harness.refresh()

    harness.driver.begin_guiding = begin_guiding  # type: ignore[method-assign]
    with pytest.raises(NotReady, match="joint2: stopped before the motion began"):
        harness.axes.begin_guiding([0, 1])
    names = [call[0] for call in harness.driver.calls]
    assert names[names.index("begin_guiding") + 1 :] == ["stop"]
