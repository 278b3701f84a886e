"""A drive that does not answer gets no setpoint that it could not follow when it answers again."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.plugins.cia402.looped_drive import PERIOD_S, LoopedDrive

from robotd.api import CommandMode, DeviceTimeout, Operation, Profile
from robotd_cia402.controlword import Control, DriveState
from robotd_cia402.silent_drive import Acknowledgement, takes_away

SPEED = 1.0  # rad/s of the stream


class Stream:
    """A stream of positions, one a period, that waits for the drive as the core does."""

    def __init__(self, looped: LoopedDrive) -> None:
        self.looped, self.position = looped, 0.0
        looped.commands.prepare_stream()
        looped.commands.begin_stream()

    def run(self, seconds: float) -> None:
        image = self.looped.image
        for _ in range(round(seconds / PERIOD_S)):
            if image.silent[0]:
                self.position = float(image.position_command[0])
                self.looped.axis.follow(self.position, 0.0)
            else:
                self.position += SPEED * PERIOD_S
                self.looped.axis.follow(self.position, SPEED)
            self.looped.run(PERIOD_S)


@pytest.fixture
def on() -> LoopedDrive:
    made = LoopedDrive()
    made.commands.enable(1.0)
    return made


def targets(looped: LoopedDrive) -> list[float]:
    """Return the list of position targets that the drive executes from now on, growing."""
    seen: list[float] = []
    sync = looped.drive.sync

    def record(period_s: float) -> None:
        seen.append(looped.objects.dictionary[0x607A, 0] * looped.axis.scaling.position)
        sync(period_s)

    looped.drive.sync = record  # type: ignore[method-assign]
    return seen


@pytest.mark.parametrize("missed", [1, 2, 3, 5, 20, 200])
def test_a_path_waits_for_a_drive_and_goes_on_from_its_last_setpoint(
    on: LoopedDrive, missed: int
) -> None:
    stream, seen = Stream(on), targets(on)
    stream.run(0.5)
    on.deaf = True
    stream.run(missed * PERIOD_S)
    on.deaf = False
    before = len(seen)
    stream.run(0.2)
    steps = np.abs(np.diff(seen))
    assert steps.max() <= 4 * SPEED * PERIOD_S + 1e-4, "those that were under way, at the most"
    assert steps[before + 3 :] == pytest.approx(SPEED * PERIOD_S, abs=1e-4)
    assert not on.image.silent[0]
    assert on.image.operation[0] == Operation.STREAM


def test_a_silent_drive_that_is_not_lost_is_shown_with_the_command_that_it_has(
    on: LoopedDrive,
) -> None:
    stream = Stream(on)
    stream.run(0.3)
    on.deaf = True
    stream.run(10 * PERIOD_S)
    assert on.image.silent[0]
    assert not on.image.offline[0]
    assert on.image.velocity_command[0] == 0.0
    assert on.image.position_command[0] == pytest.approx(on.drive.position, abs=0.1)


def test_a_fast_setpoint_is_withheld_sooner_than_a_slow_one() -> None:
    def missed_before(step: float) -> int:
        sent = Acknowledgement(latency=2)
        for number in range(8):
            sent.note(number * step)
        for missed in range(9):
            if sent.check(missed, 8 * step, 0.01, unreached=False):
                return missed
        return 9

    assert missed_before(0.009) == 1, "three of them are more than a period at the limit"
    assert missed_before(0.0035) == 2
    assert missed_before(0.0) == 3, "nothing is known of it then"


def test_a_drive_that_certainly_missed_its_setpoints_goes_on_from_the_acknowledged_one() -> None:
    sent = Acknowledgement(latency=1)
    for position in (0.0, 0.1, 0.2, 0.3):
        sent.note(position)
    assert sent.check(2, 0.4, 0.1, unreached=True)
    assert sent.command(None) == 0.1


@pytest.mark.parametrize("reported", [0.15, 0.25, -5.0, 5.0, None])
def test_the_executed_setpoint_is_one_that_was_under_way(reported: float | None) -> None:
    sent = Acknowledgement(latency=1)
    for position in (0.0, 0.1, 0.2, 0.3):
        sent.note(position)
    sent.check(3, 0.4, 0.1, unreached=False)
    expected = 0.3 if reported is None else min(max(reported, 0.0), 0.3)
    assert sent.command(reported) == expected


@pytest.mark.parametrize(
    ("before", "word", "passes"),
    [
        (0x0F, 0x0F, False),
        (0x0F, 0x02, True),  # quick stop
        (0x02, 0x02, True),  # goes on to be sent until the drive has it
        (0x0F, 0x06, True),
        (0x0F, 0x00, True),
        (0x0F, 0x0F | int(Control.HALT), True),
        (0x0F | int(Control.HALT), 0x0F, False),
        (0x1F, 0x0F, True),  # the end of a homing
        (0x0F, 0x1F, False),
        (0x06, 0x07, False),
        (0x07, 0x0F, False),
        (0x00, 0x80, False),
    ],
)
def test_only_what_takes_away_passes_to_a_silent_drive(
    before: int, word: int, passes: bool
) -> None:
    assert takes_away(word, before) is passes


def test_a_servo_that_is_switched_off_while_the_drive_is_silent_goes_off_with_its_first_frame(
    on: LoopedDrive,
) -> None:
    stream = Stream(on)
    stream.run(0.3)
    on.deaf = True
    stream.run(5 * PERIOD_S)
    on.axis.power.release(on.axis.report.state)
    stream.run(5 * PERIOD_S)
    on.deaf = False
    on.run(3 * PERIOD_S)
    assert on.axis.report.state is not DriveState.OPERATION_ENABLED


def test_a_servo_is_not_switched_on_while_the_drive_is_silent() -> None:
    """It would go on with the first frame that it gets, at a position of before."""
    looped = LoopedDrive()
    looped.commands.enable(1.0)
    looped.commands.disable(1.0)
    looped.deaf = True
    looped.run(5 * PERIOD_S)
    with pytest.raises(DeviceTimeout, match="the servo did not go on"):
        looped.commands.enable(0.5)
    looped.deaf = False
    looped.run(10 * PERIOD_S)
    assert not looped.axis.report.powered


def test_a_lost_drive_gets_a_quick_stop_and_no_setpoint(on: LoopedDrive) -> None:
    stream, seen = Stream(on), targets(on)
    stream.run(0.5)
    on.axis.brake(on.axis.options.stop_deceleration_rad_s2)  # as the supervision of a lost node
    on.objects.node.online = False
    on.deaf = True
    on.run(50 * PERIOD_S)
    on.deaf = False
    on.objects.node.online = True
    on.axis.resume()
    on.run(0.5)
    steps = np.abs(np.diff(seen))
    assert steps.max() <= 3 * SPEED * PERIOD_S + 1e-4
    assert on.axis.report.state is DriveState.QUICK_STOP_ACTIVE
    assert on.image.operation[0] == Operation.IDLE
    on.commands.move(0.1, Profile(1.0, 5.0, 5.0))
    on.run(3.0)
    assert on.drive.position == pytest.approx(0.1, abs=1e-3)


def test_a_jog_is_stopped_while_the_drive_is_silent() -> None:
    looped = LoopedDrive(velocity_mode="csv")
    looped.commands.enable(1.0)
    looped.commands.set_mode(CommandMode.VELOCITY)
    looped.commands.jog(Profile(1.0, 5.0, 5.0))
    looped.run(0.5)
    looped.mute = True
    looped.commands.stop()
    looped.run(0.5)
    before = looped.drive.position
    looped.run(0.1)
    assert looped.drive.position == pytest.approx(before, abs=1e-6)


def test_a_velocity_that_changed_during_a_silence_is_reached_by_a_ramp() -> None:
    looped = LoopedDrive(velocity_mode="csv", stop_deceleration_rad_s2=5.0)
    looped.commands.enable(1.0)
    looped.commands.set_mode(CommandMode.VELOCITY)
    looped.commands.prepare_stream()
    looped.commands.begin_stream()
    sent: list[float] = []
    put = looped.objects.put

    def record(values: tuple[int, ...]) -> None:
        sent.append(values[3] * looped.axis.scaling.velocity)
        put(values)

    looped.objects.put = record  # type: ignore[method-assign]
    for period in range(100):
        looped.deaf = 40 <= period < 60
        looped.axis.follow(math.nan, period * 5.0 * PERIOD_S)
        looped.run(PERIOD_S)
    assert looped.drive.position > 0.0
    assert sent[-1] == pytest.approx(99 * 5.0 * PERIOD_S, abs=0.45)
    assert np.abs(np.diff(sent)).max() <= 5.0 * PERIOD_S * 1.01 + 1e-4
