"""Single setpoints of streams: when due, at which velocity, too late, and the last one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from robotd.api import (
    Capability,
    CommandMode,
    FloatArray,
    LateSetpoint,
    Operation,
    ProcessImage,
    Underrun,
)
from robotd_conformance.checks.harness import SETTLED_RAD, STANDSTILL_RAD_S, Harness
from robotd_conformance.checks.mixed_motion import SLOWEST_AXIS, modes_of
from robotd_conformance.checks.recorded_motion import judge, ramped
from robotd_conformance.checks.test_units import LAG_S

SHARE, RAMP_S = 0.25, 0.1  # of a profile's speed, and the time to reach it
CRUISE_S = 0.25  # until it is looked at
AHEAD = 0.25  # periods by which a command may be off its setpoints
DUE = (1.0, 0.6, 0.8)  # periods ahead
RESTS_S = 0.7  # of a stream, longer than a device waits for setpoints
OFF_RAD = 0.02  # of a setpoint that is too late
IN_TIME = 0.1  # periods
STAYS_AWAY_S, STOPS_S, LOOK_S = 0.2, 1.0, 0.15  # until setpoints stay away, longest reaction
WRONG_RAD = 1.0  # position of a setpoint for an axis in velocity mode


class Path:
    """Setpoints of one stream, and the commands that the device shows for them.

    Each axis speeds up to its ``speeds``, and cruises; ``brakes_s`` is when it slows down. The
    command of a device that is in time is ``setpoint`` of the values' time.

    Attributes:
        commands: (time, position commands, velocity commands) of each period.
    """

    def __init__(self, harness: Harness, speeds: FloatArray, brakes_s: float = np.inf) -> None:
        self.harness, self.speeds, self.brakes_s = harness, speeds, brakes_s
        self.start = harness.image.position_command.copy()
        self.began_ns = harness.clock.now_ns()
        self.commands: list[tuple[float, FloatArray, FloatArray]] = []

    def begin_again(self, speeds: FloatArray) -> None:
        """Begin a path with ``speeds`` at the end of this one, where the axes rest."""
        start, began_ns = self.setpoint(np.inf)[0], self.harness.clock.now_ns()
        self.start, self.speeds, self.began_ns = start, speeds, began_ns

    def time_s(self, now_ns: int) -> float:
        return (now_ns - self.began_ns) * 1e-9

    def setpoint(self, time_s: float) -> tuple[FloatArray, FloatArray]:
        way_s, share = ramped(max(0.0, time_s), RAMP_S, self.brakes_s)
        return self.start + way_s * self.speeds, share * self.speeds

    def note(self, image: ProcessImage) -> None:
        slow = self.harness.drivers.axes.feedback_period_s  # commands are newer than values
        time_s = self.time_s(image.stamp_ns if slow else image.fresh_ns)
        commands = image.position_command.copy(), image.velocity_command.copy()
        self.commands.append((time_s, *commands))

    def lags(self) -> FloatArray:
        """(n, n_axes) periods by which the command is behind its setpoints, at full speed."""
        behind = [
            (self.setpoint(time_s)[0] - position) / self.speeds
            for time_s, position, _ in self.commands
            if RAMP_S + 0.02 < time_s < self.brakes_s
        ]
        return np.array(behind) / self.harness.period_s

    def __call__(self, image: ProcessImage) -> None:
        self.note(image)
        setpoint = self.setpoint(self.time_s(self.harness.due_ns))
        if self.harness.stepped:  # nothing is late
            self.harness.drivers.axes.stream(*setpoint, self.harness.due_ns)
        else:
            self.harness.stream(*setpoint)


@pytest.fixture
def stepped(unopened: Harness) -> Harness:
    """A started harness in simulated time: single periods are known, and nothing real jumps."""
    if not unopened.stepped:
        pytest.skip("single setpoints are judged in simulated time")
    if unopened.robot.axes.trajectories_on_device:
        pytest.skip("positions are not streamed: trajectories run on the device")
    unopened.start()
    return unopened


def different_speeds(harness: Harness) -> FloatArray:
    """Return (n_axes,) speeds, none as another one."""
    return np.asarray(harness.speeds(SHARE) * np.linspace(1.0, SLOWEST_AXIS, harness.count))


def both_ways(harness: Harness) -> Sequence[FloatArray]:
    return different_speeds(harness), -different_speeds(harness)


@pytest.mark.clause("AxisDriver.stream/setpoint")
def test_setpoints_are_reached_however_far_ahead_they_are_sent(stepped: Harness) -> None:
    """A device that holds, or holds setpoints ahead, may take them in steps of its own."""
    driver, period_ns = stepped.drivers.axes, stepped.robot.control_loop.period_ns
    if driver.underrun is not Underrun.EXTRAPOLATE or driver.stream_buffer_s:
        pytest.skip("setpoints are not extrapolated")
    for speeds in both_ways(stepped):
        path, count = Path(stepped, speeds, brakes_s=CRUISE_S), 0

        def send(image: ProcessImage, path: Path = path) -> None:
            nonlocal count
            path.note(image)
            due_ns = image.stamp_ns + round(DUE[count % len(DUE)] * period_ns)
            driver.stream(*path.setpoint(path.time_s(due_ns)), due_ns)
            count += 1

        with stepped.robot.axes.claimed("conformance", stepped.all), stepped.each_period(send):
            stepped.pass_time(CRUISE_S + RAMP_S + 0.02)
        stepped.rest()
        worst = np.abs(path.lags()).max(0)
        for axis in stepped.all:
            assert worst[axis] <= AHEAD, (
                f"axis {axis}: off the line by {worst[axis]:.2f} periods at setpoints that are due"
                f" {min(DUE):g} to 1 periods ahead"
            )


@pytest.mark.clause("AxisDriver.stream/position")
def test_a_setpoint_is_passed_at_its_velocity(stepped: Harness) -> None:
    """The velocities of some setpoints are half of that at which the positions go on."""
    for speeds in both_ways(stepped):
        path = Path(stepped, speeds, brakes_s=CRUISE_S)
        halved = RAMP_S + 0.05, RAMP_S + 0.1

        def send(
            image: ProcessImage, path: Path = path, halved: tuple[float, float] = halved
        ) -> None:
            path.note(image)
            time_s = path.time_s(stepped.due_ns)
            position, velocity = path.setpoint(time_s)
            half = halved[0] < time_s < halved[1]
            stepped.stream(position, 0.5 * velocity if half else velocity)

        with stepped.robot.axes.claimed("conformance", stepped.all), stepped.each_period(send):
            stepped.pass_time(CRUISE_S + RAMP_S + 0.02)
        stepped.rest()
        if np.abs(path.lags()).max() > IN_TIME:
            pytest.skip("commands are not read at the time of a setpoint")
        shares = np.array([
            velocity / speeds
            for time_s, _, velocity in path.commands
            if halved[0] + 2 * stepped.period_s < time_s < halved[1] - 2 * stepped.period_s
        ])  # fmt: skip
        for axis in stepped.all:
            assert shares[:, axis].max() < 0.75, (
                f"axis {axis} passes setpoints with {shares[:, axis].max():.0%} of the speed of"
                " its positions, their velocity is 50%"
            )


@pytest.mark.clause("AxisDriver.stream/late")
def test_a_setpoint_that_was_too_late_has_no_effect(stepped: Harness) -> None:
    driver, period_ns = stepped.drivers.axes, stepped.robot.control_loop.period_ns
    for speeds in both_ways(stepped):
        path, rejected = Path(stepped, speeds, brakes_s=CRUISE_S), list[float]()

        def send(image: ProcessImage, path: Path = path, rejected: list[float] = rejected) -> None:
            time_s = path.time_s(stepped.due_ns)
            if time_s < RAMP_S + 0.05 or rejected:
                if not rejected or time_s > rejected[0] + 4.5 * stepped.period_s:
                    path(image)
                else:
                    path.note(image)
                return
            path.note(image)
            position, velocity = path.setpoint(time_s)
            try:
                driver.stream(position + OFF_RAD, velocity, image.stamp_ns + period_ns // 10)
            except LateSetpoint:
                rejected.append(time_s)
            else:
                rejected.append(np.inf)

        with stepped.robot.axes.claimed("conformance", stepped.all), stepped.each_period(send):
            stepped.pass_time(RAMP_S + 0.05)
            stepped.periods(8)
            if rejected == [np.inf]:
                pytest.skip("no setpoint is too late for the device")
            stepped.pass_time(CRUISE_S)
        stepped.rest()
        off = np.array(
            [path.setpoint(time_s)[0] - position for time_s, position, _ in path.commands]
        )
        gap_rad = 6 * stepped.period_s * np.abs(speeds)
        for axis in stepped.all:
            assert np.abs(off[:, axis]).max() < 0.25 * OFF_RAD + gap_rad[axis], (
                f"axis {axis} was led {np.abs(off[:, axis]).max():.3g} rad off its line by a"
                " setpoint that was rejected as too late"
            )


@pytest.mark.clause("AxisDriver.end_stream/reached", "AxisDriver.end_stream/holds")
def test_a_stream_ends_on_its_last_setpoint(stepped: Harness) -> None:
    """It is ended as soon as the last setpoint was sent, a period before that is due."""
    driver = stepped.drivers.axes
    for speeds in both_ways(stepped):
        path, last = Path(stepped, speeds), list[FloatArray]()

        def send(image: ProcessImage, path: Path = path, last: list[FloatArray] = last) -> None:
            time_s = path.time_s(stepped.due_ns)
            if time_s < CRUISE_S:
                path(image)
            elif not last:
                last.append(path.setpoint(time_s)[0])
                stepped.stream(last[0], 0.0 * path.speeds)
                driver.end_stream(stepped.all)

        driver.begin_stream(stepped.all)
        with stepped.each_period(send):
            stepped.pass_time(CRUISE_S + 0.02)
        stepped.rest()
        short = np.abs(stepped.image.position_command - last[0])
        for axis in stepped.all:
            assert short[axis] < 0.1 * abs(speeds[axis]) * stepped.period_s, (
                f"axis {axis} holds {1e3 * short[axis]:.3g} mrad away from its last setpoint"
            )


@pytest.mark.needs(Capability.VELOCITY_MODE)
@pytest.mark.clause("AxisDriver.stream/velocity")
def test_a_streamed_velocity_changes_evenly(stepped: Harness) -> None:
    """The way is that of the mean velocity."""
    stepped.set_velocity_mode()
    unknown = np.full(stepped.count, np.nan)
    granted = (LAG_S + stepped.drivers.axes.stream_buffer_s) / stepped.period_s
    for speeds in both_ways(stepped):
        path = Path(stepped, speeds, brakes_s=CRUISE_S)

        def send(image: ProcessImage, path: Path = path) -> None:
            path.note(image)
            stepped.stream(unknown, path.setpoint(path.time_s(stepped.due_ns))[1])

        axes = stepped.robot.axes
        with (
            axes.claimed("conformance", stepped.all, CommandMode.VELOCITY),
            stepped.each_period(send),
        ):
            stepped.pass_time(CRUISE_S + RAMP_S + 0.02)
        stepped.rest()
        lags = path.lags()
        for axis in stepped.all:
            low, high = lags[:, axis].min(), lags[:, axis].max()
            assert -AHEAD < low <= high < granted, (
                f"axis {axis}: its way is {low:.2f} to {high:.2f} periods behind that of an even"
                " change of its velocity"
            )


@pytest.mark.needs(Capability.VELOCITY_MODE)
@pytest.mark.clause("AxisDriver.stream/velocity")
def test_between_two_setpoints_a_streamed_velocity_is_between_theirs(stepped: Harness) -> None:
    """Velocities go up and down in each period; values are read in the middle, too."""
    stepped.set_velocity_mode()
    driver, image, period_ns = (
        stepped.drivers.axes,
        stepped.image,
        stepped.robot.control_loop.period_ns,
    )
    unknown = np.full(stepped.count, np.nan)
    for speeds in both_ways(stepped):
        ways, shares = list[FloatArray](), list[FloatArray]()
        driver.begin_stream(stepped.all)
        stepped.clock.sleep_until_ns(image.stamp_ns + period_ns)
        for count in range(20):
            positions = [image.position_command.copy()]
            driver.stream(unknown, (count % 2) * SHARE * speeds, stepped.due_ns)
            stepped.clock.sleep_until_ns(image.stamp_ns + period_ns // 2)
            driver.read(image)
            positions.append(image.position_command.copy())
            share = image.velocity_command / (SHARE * speeds)
            stepped.clock.sleep_until_ns(image.stamp_ns + period_ns)
            if count % 2:
                ways.append(np.diff([*positions, image.position_command], axis=0))
                shares.append(share)
        driver.end_stream(stepped.all)
        stepped.rest()
        if not np.any(ways, axis=(0, 2)).all():
            pytest.skip("commands change once in each period")
        for axis, share in enumerate(np.mean(shares, axis=0)):
            assert 0.25 < share < 0.75, (
                f"axis {axis}: {share:.0%} of the change of its velocity is made in the first half"
                " of the period, 50% would be even"
            )


@pytest.mark.needs(Capability.VELOCITY_MODE)
@pytest.mark.clause("AxisDriver.begin_stream/modes", "AxisDriver.stream/nan")
@pytest.mark.clause("AxisDriver.stream/position", "AxisDriver.stream/velocity")
@pytest.mark.parametrize("first", [CommandMode.VELOCITY, CommandMode.POSITION])
def test_axes_of_both_modes_stream_together(streamed: Harness, first: CommandMode) -> None:
    """Every second axis is in the other mode; the stream is begun in both orders."""
    by_velocity = np.arange(streamed.count) % 2 == (first is CommandMode.POSITION)
    for axis in np.flatnonzero(by_velocity).tolist():
        streamed.robot.axes.set_command_mode(axis, CommandMode.VELOCITY)
    driver, problems = streamed.drivers.axes, list[str]()
    for axes, unknown in ((streamed.all, np.nan), (streamed.all[::-1], WRONG_RAD)):
        speeds = different_speeds(streamed) * (1.0 if axes[0] == 0 else -1.0)
        path = Path(streamed, speeds, brakes_s=CRUISE_S)

        def send(image: ProcessImage, path: Path = path, unknown: float = unknown) -> None:
            position, velocity = path.setpoint(path.time_s(streamed.due_ns))
            streamed.stream(np.where(by_velocity, unknown, position), velocity)

        driver.begin_stream(axes)
        with streamed.recording() as recording, streamed.each_period(send):
            streamed.pass_time(CRUISE_S + RAMP_S + streamed.drivers.axes.stream_buffer_s + 0.05)
        driver.end_stream(axes)
        streamed.rest()
        off = streamed.image.position - path.setpoint(CRUISE_S + RAMP_S)[0]
        granted = SETTLED_RAD + by_velocity * 0.1 * np.abs(speeds) * CRUISE_S
        problems += [
            f"axis {axis}: {off[axis]:.3g} rad off after a stream of"
            f" {'velocities' if by_velocity[axis] else 'positions'} beside others"
            for axis in streamed.all
            if abs(off[axis]) > granted[axis]
        ]
        judge(streamed, recording, problems)


@pytest.mark.clause("AxisDriver.stream/arrays")
@pytest.mark.parametrize("mode", [CommandMode.POSITION, CommandMode.VELOCITY])
def test_setpoints_may_be_overwritten_after_the_call(streamed: Harness, mode: CommandMode) -> None:
    if mode not in modes_of(streamed):
        pytest.skip("there is no velocity mode")
    for axis in streamed.all:
        streamed.robot.axes.set_command_mode(axis, mode)
    path = Path(streamed, different_speeds(streamed), brakes_s=CRUISE_S)
    position, velocity = path.setpoint(0.0)

    def send(image: ProcessImage) -> None:
        position[:], velocity[:] = path.setpoint(path.time_s(streamed.due_ns))
        streamed.stream(position, velocity)
        position[:], velocity[:] = path.start, -path.speeds

    streamed.drivers.axes.begin_stream(streamed.all)
    with streamed.recording() as recording, streamed.each_period(send):
        streamed.pass_time(CRUISE_S + RAMP_S + streamed.drivers.axes.stream_buffer_s + 0.05)
        position, velocity = path.setpoint(np.inf)
    streamed.drivers.axes.end_stream(streamed.all)
    streamed.rest()
    way = path.setpoint(np.inf)[0] - path.start
    gone = (streamed.image.position - path.start) / way
    problems = [
        f"axis {axis} has gone {gone[axis]:.0%} of its way"
        for axis in streamed.all
        if abs(gone[axis] - 1.0) > 0.15
    ]
    judge(streamed, recording, problems)


@pytest.mark.clause("AxisDriver.begin_stream/operation", "AxisDriver.stream/position")
def test_a_stream_that_rests_goes_on(streamed: Harness) -> None:
    """The same setpoint for longer than any time-out, and then others, back to the begin."""
    driver, speeds = streamed.drivers.axes, different_speeds(streamed)
    start = streamed.image.position_command.copy()
    for sign in (1.0, -1.0):
        path = Path(streamed, sign * speeds, brakes_s=CRUISE_S)
        driver.begin_stream(streamed.all)
        with streamed.recording() as recording, streamed.each_period(path):
            streamed.pass_time(CRUISE_S + RAMP_S + RESTS_S)
            shown = streamed.image.operation.copy()
            path.begin_again(-sign * speeds)
            streamed.pass_time(CRUISE_S + RAMP_S + driver.stream_buffer_s + 0.1)
        driver.end_stream(streamed.all)
        streamed.rest()
        off = np.abs(streamed.image.position - start)
        problems = [
            f"axis {axis}: {Operation(int(shown[axis])).name} shown after {RESTS_S:g} s of rest,"
            f" then {off[axis]:.3g} rad off"
            for axis in streamed.all
            if shown[axis] != Operation.STREAM or off[axis] > SETTLED_RAD
        ]
        judge(streamed, recording, problems)


@pytest.mark.needs(Capability.DEVICE_WATCHDOG)
@pytest.mark.clause("backend/watchdog")
def test_axes_stop_each_time_that_setpoints_stay_away(streamed: Harness) -> None:
    """In each mode, both ways, and in the next connection."""
    connection = streamed.robot.connection
    for turn in range(3):
        if turn == 2:
            connection.stop_communication()
            streamed.start()
        for number, mode in enumerate(modes_of(streamed)):
            sign = -1.0 if (turn + number) % 2 else 1.0
            streamed.enable()
            for axis in streamed.all:
                streamed.robot.axes.set_command_mode(axis, mode)
            leave_alone(streamed, sign * different_speeds(streamed), mode)
            streamed.drivers.axes.end_stream(streamed.all)
            streamed.rest()
    streamed.enable()


def leave_alone(harness: Harness, speeds: FloatArray, mode: CommandMode) -> None:
    """Begin a stream at ``speeds`` and send no more setpoints; the axes have to stop."""
    path = Path(harness, speeds)

    def send(image: ProcessImage) -> None:
        if path.time_s(harness.due_ns) < STAYS_AWAY_S:
            path(image)

    harness.drivers.axes.begin_stream(harness.all)
    with harness.each_period(send):
        harness.pass_time(STAYS_AWAY_S)
        moved = np.abs(harness.image.position - path.start)
        assert (moved > SETTLED_RAD).all(), f"a stream of {mode.name.lower()} setpoints is ignored"
        harness.until(
            lambda: bool((np.abs(harness.image.velocity) < STANDSTILL_RAD_S).all()),
            f"the axes stop without setpoints in {mode.name.lower()} mode",
            STOPS_S,
        )
        start = harness.image.position.copy()
        harness.pass_time(LOOK_S)
    went = np.abs(harness.image.position - start)
    assert went.max() <= SETTLED_RAD, (
        f"axis {went.argmax()} goes on by {went.max():.3g} rad without setpoints"
    )
