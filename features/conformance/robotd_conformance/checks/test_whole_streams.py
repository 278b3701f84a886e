"""Streams as a whole: in both modes at once, at rest, and left alone by their sender."""

from __future__ import annotations

import numpy as np
import pytest

from robotd.api import (
    Capability,
    CommandMode,
    FloatArray,
    Operation,
    ProcessImage,
)
from robotd_conformance.checks.harness import SETTLED_RAD, STANDSTILL_RAD_S, Harness
from robotd_conformance.checks.mixed_motion import modes_of
from robotd_conformance.checks.recorded_motion import judge, ramped
from robotd_conformance.checks.stream_path import CRUISE_S, RAMP_S, Path, different_speeds

RESTS_S = 0.7  # of a stream, longer than a device waits for setpoints
STAYS_AWAY_S, STOPS_S, LOOK_S = 0.2, 1.0, 0.15  # until setpoints stay away, longest reaction


@pytest.mark.needs(Capability.VELOCITY_MODE)
@pytest.mark.clause("AxisDriver.begin_stream/modes", "AxisDriver.stream/nan")
@pytest.mark.clause("AxisDriver.stream/position", "AxisDriver.stream/velocity")
@pytest.mark.parametrize("first", [CommandMode.VELOCITY, CommandMode.POSITION])
@pytest.mark.short_period
def test_axes_of_both_modes_stream_together(streamed: Harness, first: CommandMode) -> None:
    """Every second axis is in the other mode; the stream is begun in both orders."""
    by_velocity = np.arange(streamed.count) % 2 == (first is CommandMode.POSITION)
    for axis in np.flatnonzero(by_velocity).tolist():
        streamed.robot.axes.set_command_mode(axis, CommandMode.VELOCITY)
    driver, problems = streamed.drivers.axes, list[str]()
    nothing = np.full(streamed.count, np.nan)
    for axes, unknown in ((streamed.all, nothing), (streamed.all[::-1], streamed.wrong_positions)):
        speeds = different_speeds(streamed) * (1.0 if axes[0] == 0 else -1.0)
        path = Path(streamed, speeds, brakes_s=CRUISE_S)

        def send(image: ProcessImage, path: Path = path, unknown: FloatArray = unknown) -> None:
            position, velocity = path.setpoint(path.time_s(streamed.due_ns))
            streamed.stream(np.where(by_velocity, unknown, position), velocity)

        driver.begin_stream(axes)
        with streamed.recording() as recording, streamed.each_period(send):
            streamed.pass_time(CRUISE_S + RAMP_S + streamed.drivers.axes.stream_buffer_s + 0.05)
        driver.end_stream(axes)
        streamed.rest()
        off = streamed.image.position - path.setpoint(CRUISE_S + RAMP_S)[0]
        granted = streamed.pose.tolerance + by_velocity * 0.1 * np.abs(speeds) * CRUISE_S
        problems += [
            f"axis {axis}: {off[axis]:.3g} rad off after a stream of"
            f" {'velocities' if by_velocity[axis] else 'positions'} beside others"
            for axis in streamed.all
            if abs(off[axis]) > granted[axis]
        ]
        judge(streamed, recording, problems)


@pytest.mark.clause("AxisDriver.stream/arrays")
@pytest.mark.parametrize("mode", [CommandMode.POSITION, CommandMode.VELOCITY])
@pytest.mark.short_period
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
    travel = path.setpoint(np.inf)[0] - path.start
    gone = (streamed.image.position - path.start) / travel
    problems = [
        f"axis {axis} has gone {gone[axis]:.0%} of its travel"
        for axis in streamed.all
        if abs(gone[axis] - 1.0) > 0.15
    ]
    judge(streamed, recording, problems)


@pytest.mark.clause("AxisDriver.begin_stream/operation", "AxisDriver.stream/position")
def test_a_stream_that_rests_goes_on(streamed: Harness) -> None:
    """The same setpoint for longer than any time-out, and then others, back to the start.

    From the start pose into the travel of the axes, and from its end to the other side.
    """
    driver, speeds = streamed.drivers.axes, different_speeds(streamed)
    travel = path_end(streamed, speeds)
    for sign in (1.0, -1.0):
        if sign < 0.0:
            streamed.move(streamed.all, streamed.image.position_command + travel)
            streamed.rest()
        start = streamed.image.position_command.copy()
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
            if shown[axis] != Operation.STREAM or off[axis] > streamed.pose.tolerance[axis]
        ]
        judge(streamed, recording, problems)


@pytest.mark.needs(Capability.DEVICE_WATCHDOG)
@pytest.mark.clause("backend/watchdog")
@pytest.mark.short_period
def test_axes_stop_each_time_that_setpoints_stay_away(streamed: Harness) -> None:
    """Checks each mode, both directions and the next connection: between start and travel."""
    connection, travel = streamed.robot.connection, streamed.travel()
    for turn in range(3):
        if turn == 2:
            connection.stop_communication()
            streamed.start()
        for number, mode in enumerate(modes_of(streamed)):
            sign = -1.0 if (turn + number) % 2 else 1.0
            streamed.enable()
            begin = streamed.pose.position
            assert begin is not None
            streamed.move(streamed.all, begin if sign > 0.0 else begin + travel)
            streamed.rest()
            for axis in streamed.all:
                streamed.robot.axes.set_command_mode(axis, mode)
            leave_alone(streamed, sign * different_speeds(streamed), mode)
            streamed.drivers.axes.end_stream(streamed.all)
            streamed.rest()
    streamed.enable()


def path_end(harness: Harness, speeds: FloatArray) -> FloatArray:
    """Return (n_axes,) the displacement of a path that is slowed down at ``CRUISE_S``."""
    return np.asarray(ramped(np.inf, RAMP_S, CRUISE_S)[0] * speeds)


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
