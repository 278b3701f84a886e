"""Axis commands: what is refused, why, and that nothing reaches the driver then."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
from tests.unit.device.rig import ALL, Rig

from robotd.device.axes import Axes, Jog, Move, each
from robotd.device.capabilities import Capability
from robotd.device.drivers import Profile
from robotd.device.state import CommandMode, Operation
from robotd.errors import (
    DeviceTimeout,
    InvalidArgument,
    NotReady,
    OperationError,
    RobotdError,
    Unsupported,
)

PROFILE = Profile(1.0, 5.0, 5.0)
UNLIMITED_AXIS = 2

Command = Callable[[Axes, int], Any]

ONE_AXIS: dict[str, Command] = {
    "servo": lambda axes, axis: axes.servo(axis, True),
    "clear_alarm": lambda axes, axis: axes.clear_alarm(axis),
    "set_command_mode": lambda axes, axis: axes.set_command_mode(axis, 1),
    "set_polarity": lambda axes, axis: axes.set_polarity(axis, -1),
    "set_gear_ratio": lambda axes, axis: axes.set_gear_ratio(axis, 1000.0, 2.0),
    "home": lambda axes, axis: axes.home(axis),
    "move": lambda axes, axis: axes.move([Move(axis, 0.5, PROFILE)]),
}


def jogging(rig: Rig) -> Rig:
    rig.driver.image.mode[:] = CommandMode.VELOCITY
    rig.refresh()
    return rig


def servo_off(rig: Rig) -> Rig:
    rig.driver.image.servo_on[:] = False
    rig.refresh()
    return rig


def refused(rig: Rig, error: type[RobotdError], text: str, command: Callable[[], Any]) -> None:
    before = list(rig.driver.calls)
    with pytest.raises(error, match=text):
        command()
    assert rig.driver.calls == before


@pytest.mark.parametrize("command", ONE_AXIS.values(), ids=ONE_AXIS)
@pytest.mark.parametrize("axis", [-1, 3])
def test_an_axis_that_is_not_there_is_refused(rig: Rig, command: Command, axis: int) -> None:
    text = rf"^axis {axis} is outside 0\.\.2$"
    refused(rig, InvalidArgument, text, lambda: command(rig.axes, axis))


@pytest.mark.parametrize("command", ONE_AXIS.values(), ids=ONE_AXIS)
def test_nothing_is_commanded_before_the_engine_is_ready(command: Command) -> None:
    rig = Rig()
    text = r"^engine is not ready \(state Idle\)$"
    refused(rig, NotReady, text, lambda: command(rig.axes, 0))


def test_a_servo_obeys_within_the_descriptors_time_out(rig: Rig) -> None:
    timeout_s = rig.engine.settings.servo_timeout_s
    rig.axes.servo(1, False)
    rig.axes.servo(1, True)
    assert rig.driver.calls == [("servo", 1, False, timeout_s), ("servo", 1, True, timeout_s)]


def test_a_servo_in_alarm_stays_off_until_the_alarm_is_cleared(rig: Rig) -> None:
    rig.driver.image.amp_alarm[0], rig.driver.image.alarm_code[0] = True, 16
    servo_off(rig)
    text = "^joint1: amplifier alarm 16; clear it first$"
    refused(rig, NotReady, text, lambda: rig.axes.servo(0, True))
    rig.axes.servo(0, False)
    rig.axes.clear_alarm(0)
    rig.refresh()
    rig.axes.servo(0, True)


@pytest.mark.parametrize("mode", [-1, 3])
def test_an_unknown_mode_is_refused(rig: Rig, mode: int) -> None:
    text = f"^joint1: mode {mode} is not 0, 1 or 2$"
    refused(rig, InvalidArgument, text, lambda: rig.axes.set_command_mode(0, mode))


@pytest.mark.parametrize("operation", [op for op in Operation if op is not Operation.IDLE])
def test_mode_and_home_need_an_idle_axis(rig: Rig, operation: Operation) -> None:
    rig.driver.image.operation[0] = operation
    rig.refresh()
    text = f"needs an idle axis, this one is in {operation.name.lower()}$"
    refused(rig, NotReady, text, lambda: rig.axes.set_command_mode(0, 1))
    refused(rig, NotReady, text, lambda: rig.axes.home(0))


def test_scaling_changes_only_while_the_servo_is_off(rig: Rig) -> None:
    refused(rig, NotReady, "only while the servo is off", lambda: rig.axes.set_polarity(0, 1))
    refused(rig, NotReady, "only while the servo is off", lambda: rig.axes.set_gear_ratio(0, 1, 1))
    servo_off(rig)
    rig.axes.set_polarity(0, -1)
    rig.axes.set_gear_ratio(0, 1000.0, 2.0)
    assert rig.driver.calls == [("set_polarity", 0, -1), ("set_gear_ratio", 0, 1000.0, 2.0)]


@pytest.mark.parametrize("polarity", [0, 2, -2])
def test_a_polarity_that_is_none_is_refused(rig: Rig, polarity: int) -> None:
    text = f"^joint1: polarity {polarity} is not 1 or -1$"
    refused(servo_off(rig), InvalidArgument, text, lambda: rig.axes.set_polarity(0, polarity))


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf, 2.0**31])
def test_a_gear_ratio_that_is_none_is_refused(rig: Rig, bad: float) -> None:
    servo_off(rig)
    axes = rig.axes
    refused(
        rig,
        InvalidArgument,
        f"gear ratio numerator {bad}",
        lambda: axes.set_gear_ratio(0, bad, 1),
    )
    refused(
        rig,
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
    rig = Rig(capabilities=ALL - {missing}).make_ready()
    text = f"^{feature}: not supported by the fake backend$"
    refused(rig, Unsupported, text, lambda: command(rig.axes))


def test_moves_start_together(rig: Rig) -> None:
    rig.axes.move([Move(1, 0.5, PROFILE), Move(0, -0.5, PROFILE)])
    assert rig.driver.calls == [("move", 1, 0.5, PROFILE), ("move", 0, -0.5, PROFILE)]


def test_a_relative_move_counts_from_the_position_command(rig: Rig) -> None:
    rig.driver.image.position_command[0] = 1.5
    rig.driver.image.position[0] = 1.4
    rig.refresh()
    rig.axes.move([Move(0, 0.25, PROFILE)], relative=True)
    assert rig.driver.calls == [("move", 0, 1.75, PROFILE)]
    refused(
        rig,
        InvalidArgument,
        "joint1: target 2.25",
        lambda: rig.axes.move([Move(0, 0.75, PROFILE)], relative=True),
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
def test_a_bad_move_holds_back_the_good_ones_beside_it(rig: Rig, move: Move, text: str) -> None:
    good = Move(1, 0.5, PROFILE)
    refused(rig, InvalidArgument, text, lambda: rig.axes.move([good, move]))


def test_an_axis_without_limits_goes_anywhere(rig: Rig) -> None:
    far = Move(UNLIMITED_AXIS, 1e6, Profile(1e3, 1e4, 1e4))
    rig.axes.move([far])
    assert rig.driver.calls == [("move", UNLIMITED_AXIS, 1e6, far.profile)]


def test_no_axis_and_the_same_axis_twice_are_refused(rig: Rig) -> None:
    refused(rig, InvalidArgument, "^no axis given$", lambda: rig.axes.move([]))
    twice = [Move(1, 0.5, PROFILE), Move(1, 0.6, PROFILE)]
    refused(rig, InvalidArgument, "^axis 1 is given twice$", lambda: rig.axes.move(twice))


def test_jogs_are_checked_and_start_together(rig: Rig) -> None:
    jogging(rig)
    backwards = Profile(-3.0, 10.0, 10.0)
    rig.axes.jog([Jog(0, backwards), Jog(1, Profile(0.0, 1.0, 1.0))])
    assert [call[:2] for call in rig.driver.calls] == [("jog", 0), ("jog", 1)]
    fast = [Jog(1, PROFILE), Jog(0, Profile(-3.5, 1.0, 1.0))]
    text = r"^joint1: velocity -3\.5 rad/s .* 3 rad/s$"
    refused(rig, InvalidArgument, text, lambda: rig.axes.jog(fast))


@pytest.mark.parametrize(
    ("array", "value", "reason"),
    [
        ("offline", True, "^joint1: drive is offline$"),
        ("amp_alarm", True, "^joint1: amplifier alarm 0$"),
        ("servo_on", False, "^joint1: servo is off$"),
        ("mode", CommandMode.VELOCITY, "^joint1 is in velocity mode, not in position mode$"),
    ],
)
def test_a_state_that_forbids_motion_is_named(
    rig: Rig, array: str, value: int, reason: str
) -> None:
    getattr(rig.driver.image, array)[0] = value
    rig.refresh()
    both = [Move(1, 0.5, PROFILE), Move(0, 0.5, PROFILE)]
    refused(rig, NotReady, reason, lambda: rig.axes.move(both))


def test_a_jog_needs_velocity_mode(rig: Rig) -> None:
    text = "^joint1 is in position mode, not in velocity mode$"
    refused(rig, NotReady, text, lambda: rig.axes.jog([Jog(0, PROFILE)]))


def test_claimed_axes_refuse_everybody_but_a_stop(rig: Rig) -> None:
    with rig.axes.claimed("the test", [0, 1]):
        rig.refresh()
        text = "^joint1 is in use by the test$"
        for name in ("clear_alarm", "set_command_mode", "home", "move"):
            refused(rig, NotReady, text, lambda name=name: ONE_AXIS[name](rig.axes, 0))
        rig.axes.move([Move(2, 0.5, PROFILE)])
        rig.axes.servo(1, False)
        rig.axes.stop([0])
        rig.axes.quick_stop([0])
        assert rig.axes.refusal(0, CommandMode.POSITION, by="the test") is None
    rig.refresh()
    rig.axes.move([Move(0, 0.5, PROFILE)])
    names = [call[0] for call in rig.driver.calls]
    assert names == [
        "begin_stream", "move", "servo", "stop", "quick_stop", "end_stream", "move",
    ]  # fmt: skip


def test_a_claim_ends_with_its_block_whatever_happens_in_it(rig: Rig) -> None:
    with pytest.raises(ZeroDivisionError), rig.axes.claimed("the test", [0]):
        raise ZeroDivisionError
    rig.refresh()
    assert rig.axes.refusal(0, CommandMode.POSITION) is None
    assert rig.driver.calls[-1] == ("end_stream", [0])


def test_a_moving_axis_cannot_be_claimed(rig: Rig) -> None:
    rig.axes.move([Move(0, 0.5, PROFILE)])
    rig.refresh()
    with pytest.raises(NotReady, match="the test needs an idle axis, this one is in position"):
        rig.axes.claimed("the test", [1, 0]).__enter__()
    assert rig.axes.refusal(1, CommandMode.POSITION) is None


def test_stops_have_no_effect_before_the_engine_is_ready() -> None:
    rig = Rig()
    rig.axes.stop([0])
    rig.axes.quick_stop([0])
    assert rig.driver.calls == []


def test_rest_waits_for_standstill_and_names_who_still_moves(rig: Rig) -> None:
    rig.axes.rest([0, 1], 1.0)
    rig.driver.image.operation[1] = Operation.STOPPING
    rig.refresh()
    before_ns = rig.clock.now_ns()
    with pytest.raises(DeviceTimeout, match=r"^joint2: not at rest after 1\.0 s$"):
        rig.axes.rest([0, 1], 1.0)
    assert rig.clock.now_ns() - before_ns >= 1_000_000_000


def test_a_driver_that_fails_is_heard(rig: Rig) -> None:
    rig.driver.failures["home"] = OperationError("no index pulse")
    with pytest.raises(OperationError, match="no index pulse"):
        rig.axes.home(0)


def test_each_tries_every_axis(rig: Rig) -> None:
    rig.driver.image.amp_alarm[1] = True
    rig.refresh()
    results = each([0, 1, 2], lambda axis: rig.axes.servo(axis, True))
    assert [results[axis] is None for axis in (0, 1, 2)] == [True, False, True]
    assert isinstance(results[1], NotReady)
    assert [call[1] for call in rig.driver.calls] == [0, 2]


def test_axes_with_trajectories_on_the_device_are_claimed_and_not_streamed() -> None:
    rig = Rig(capabilities=ALL | {Capability.TRAJECTORIES_ON_DEVICE}).make_ready()
    with rig.axes.claimed("somebody", [0]):
        assert rig.axes.refusal(0, CommandMode.POSITION) is not None
    assert not any("stream" in str(call[0]) for call in rig.driver.calls)
