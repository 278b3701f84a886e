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
    ProcessImage,
    Underrun,
)
from robotd_conformance.checks.harness import Harness
from robotd_conformance.checks.stream_path import CRUISE_S, RAMP_S, SHARE, Path, different_speeds
from robotd_conformance.checks.test_units import LAG_S

AHEAD = 0.25  # periods by which a command may be off its setpoints
DUE = (1.0, 0.6, 0.8)  # periods ahead
OFF_RAD = 0.02  # of a setpoint that is too late
IN_TIME = 0.1  # periods
SHORT_STREAMS = 15


@pytest.fixture
def stepped(unopened: Harness) -> Harness:
    """A started harness in simulated time: single periods are known, and nothing real jumps."""
    if not unopened.stepped:
        pytest.skip("single setpoints are judged in simulated time")
    if unopened.robot.axes.trajectories_on_device:
        pytest.skip("positions are not streamed: trajectories run on the device")
    unopened.start()
    return unopened


def both_directions(harness: Harness) -> Sequence[FloatArray]:
    return different_speeds(harness), -different_speeds(harness)


@pytest.mark.clause("AxisDriver.stream/setpoint")
def test_setpoints_are_reached_however_far_ahead_they_are_sent(stepped: Harness) -> None:
    """A device that holds, or holds setpoints ahead, may take them in steps of its own."""
    driver, period_ns = stepped.drivers.axes, stepped.robot.control_loop.period_ns
    if driver.underrun is not Underrun.EXTRAPOLATE or driver.stream_buffer_s:
        pytest.skip("setpoints are not extrapolated")
    for speeds in both_directions(stepped):
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
    halved = RAMP_S + 0.05, RAMP_S + 0.05 + max(0.05, 10 * stepped.period_s)
    cruise_s = halved[1] + 0.05
    for speeds in both_directions(stepped):
        path = Path(stepped, speeds, brakes_s=cruise_s)

        def send(image: ProcessImage, path: Path = path) -> None:
            path.note(image)
            time_s = path.time_s(stepped.due_ns)
            position, velocity = path.setpoint(time_s)
            half = halved[0] < time_s < halved[1]
            stepped.stream(position, 0.5 * velocity if half else velocity)

        with stepped.robot.axes.claimed("conformance", stepped.all), stepped.each_period(send):
            stepped.pass_time(cruise_s + RAMP_S + 0.02)
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
    for speeds in both_directions(stepped):
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
                # Then it counts, and the commands lead to it.
                off = np.array([
                    position - path.setpoint(time_s)[0] for time_s, position, _ in path.commands
                ])  # fmt: skip
                for axis in stepped.all:
                    assert off[:, axis].max() > 0.5 * OFF_RAD, (
                        f"a setpoint of axis {axis} that was too late was neither executed nor"
                        " rejected by LateSetpoint"
                    )
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
    """The stream ends once the last setpoint was sent, a period before it is due."""
    driver = stepped.drivers.axes
    for speeds in both_directions(stepped):
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


@pytest.mark.clause(
    "AxisDriver.begin_stream/follows", "AxisDriver.stream/setpoint", "AxisDriver.end_stream/holds"
)  # fmt: skip
def test_streams_of_one_setpoint_add_up(stepped: Harness) -> None:
    """The first setpoint of a stream counts, though the others would make up for it."""
    driver = stepped.drivers.axes
    for speeds in both_directions(stepped):
        start, step = stepped.image.position_command.copy(), 0.5 * speeds * stepped.period_s
        target = start.copy()
        for _ in range(SHORT_STREAMS):
            target += step
            sent = list[bool]()

            def send(_: ProcessImage, target: FloatArray = target, sent: list[bool] = sent) -> None:
                if not sent:
                    sent.append(True)
                    stepped.stream(target, 0.0 * target)

            driver.begin_stream(stepped.all)
            with stepped.each_period(send):
                stepped.until(lambda sent=sent: bool(sent), "a period begins")  # type: ignore[misc]
            driver.end_stream(stepped.all)
            stepped.rest()
        made = (stepped.image.position_command - start) / step
        for axis in stepped.all:
            assert abs(made[axis] - SHORT_STREAMS) < 0.5, (
                f"axis {axis}: {made[axis]:.1f} of {SHORT_STREAMS} steps are made, each a stream of"
                " one setpoint"
            )


@pytest.mark.needs(Capability.VELOCITY_MODE)
@pytest.mark.clause("AxisDriver.stream/velocity")
@pytest.mark.short_period
def test_a_streamed_velocity_changes_evenly(stepped: Harness) -> None:
    """The distance is that of the mean velocity."""
    stepped.set_velocity_mode()
    unknown = np.full(stepped.count, np.nan)
    granted = (LAG_S + stepped.drivers.axes.stream_buffer_s) / stepped.period_s
    for speeds in both_directions(stepped):
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
                f"axis {axis}: its distance is {low:.2f} to {high:.2f} periods behind that of an"
                " even change of its velocity, with positions that are NaN"
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
    for speeds in both_directions(stepped):
        steps, shares = list[FloatArray](), list[FloatArray]()
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
                steps.append(np.diff([*positions, image.position_command], axis=0))
                shares.append(share)
        driver.end_stream(stepped.all)
        stepped.rest()
        if not np.any(steps, axis=(0, 2)).all():
            pytest.skip("commands change once in each period")
        for axis, share in enumerate(np.mean(shares, axis=0)):
            assert 0.25 < share < 0.75, (
                f"axis {axis}: {share:.0%} of the change of its velocity is made in the first half"
                " of the period, 50% would be even"
            )
