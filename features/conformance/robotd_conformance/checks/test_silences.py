"""Drives that are silent for a time: what they get when they answer again."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from robotd.api import Capability, FloatArray, Operation, ProcessImage, RobotdError
from robotd_conformance.checks.harness import Harness
from robotd_conformance.checks.inconclusive import UNDECIDED
from robotd_conformance.checks.recorded_motion import jog, judge, ramped
from robotd_conformance.checks.recording import MotionSamples

RAMP_S, CRUISE_S, LOOK_S = 0.2, 0.05, 0.1
STALE_SHARE, LONGEST_S = 0.7, 0.1  # of the age at which values are stale: the device is not lost
VELOCITY_SHARE = 1.2  # of the limit: the largest step of a setpoint after a silence, in a period
LATE_PERIODS = 4  # after the return: setpoints that were under way
STOPS_S = 1.0

pytestmark = pytest.mark.short_period


class WaitingStream:
    """Streams a velocity, and waits for drives that are silent, as all sources of setpoints do.

    Args:
        velocity: by time in s since the first setpoint, (n_axes,).
    """

    def __init__(self, harness: Harness, velocity: Callable[[float], FloatArray]) -> None:
        self._harness, self._velocity = harness, velocity
        self._position = harness.image.position_command.copy()
        self._began_ns = 0

    def __call__(self, image: ProcessImage) -> None:
        self._began_ns = self._began_ns or self._harness.due_ns
        velocity = self._velocity((self._harness.due_ns - self._began_ns) * 1e-9)
        further = self._position + velocity * self._harness.period_s
        self._position = np.where(image.silent, image.position_command, further)
        self._harness.stream(self._position, np.where(image.silent, 0.0, velocity))


@pytest.mark.clause("AxisDriver/silence")
def test_a_drive_that_answers_again_gets_no_step(streamed: Harness) -> None:
    """Setpoints go on meanwhile, except those of drives that are named as silent."""
    silence_s = silence(streamed)
    limits = [limit.velocity for limit in streamed.robot.axes.limits]
    for speeds in (streamed.speeds(1.0), -streamed.speeds(1.0)):  # there and back

        def velocity(time_s: float, speeds: FloatArray = speeds) -> FloatArray:
            return speeds * ramped(time_s, RAMP_S)[1]

        with streaming(streamed, velocity):
            recording = silent_for(streamed, silence_s)
        rates = np.abs(np.diff(recording.position, axis=0) / np.diff(recording.time_s)[:, None])
        fastest = rates.max(0, initial=0.0)
        problems = [
            f"axis {axis}: {fastest[axis]:.3g} rad/s after a silence of {silence_s:.3g} s, the"
            f" limit is {limits[axis]:g}"
            for axis in streamed.all
            if fastest[axis] > VELOCITY_SHARE * limits[axis]
        ]
        judge(streamed, recording, problems)


@pytest.mark.clause("AxisDriver/past")
def test_what_was_sent_in_a_silence_is_not_executed_after_it(streamed: Harness) -> None:
    """A motion out and back in the silence, twice: later nothing of it is to be seen."""
    speeds, silence_s = streamed.speeds(1.0), silence(streamed)
    if streamed.drivers.axes.stream_buffer_s:
        pytest.skip("the device holds setpoints ahead, which wait while it is frozen")
    out_s = silence_s / 2
    delay_s = streamed.response_s

    def velocity(time_s: float) -> FloatArray:
        time_s -= CRUISE_S
        if not 0.0 <= time_s < silence_s:
            return np.zeros(streamed.count)
        return speeds if time_s < out_s else -speeds

    for _ in range(2):
        with streaming(streamed, velocity, CRUISE_S):
            recording = silent_for(streamed, silence_s)
        is_late = recording.time_s > LATE_PERIODS * streamed.feedback_s + delay_s
        late = (recording.position * np.sign(speeds))[is_late]
        went = (late - late[:1]).max(
            0, initial=0.0
        )  # outwards again: a heavy joint may still be on its way back
        problems = [
            f"axis {axis} executes {went[axis]:.3g} rad of the past after a silence of"
            f" {silence_s:.3g} s"
            for axis in streamed.all
            if went[axis] > abs(speeds[axis]) * out_s / 2
        ]
        judge(streamed, recording, problems)


@pytest.mark.needs(Capability.VELOCITY_MODE)
@pytest.mark.clause("AxisDriver/takes-away")
def test_a_stop_in_a_silence_stops(streamed: Harness) -> None:
    silence_s = silence(streamed)
    streamed.set_velocity_mode()
    idle = lambda: bool((streamed.image.operation == Operation.IDLE).all())  # noqa: E731
    for sign in (1.0, -1.0):
        jog(streamed, sign * streamed.speeds(0.3))
        streamed.pass_time(RAMP_S)
        streamed.injector.freeze(True)
        streamed.pass_time(silence_s / 2)
        streamed.drivers.axes.stop(streamed.all)
        streamed.pass_time(silence_s / 2)
        streamed.injector.freeze(False)
        streamed.pass_time(silence_s / 2)  # the image shows what the silence has left
        streamed.until(idle, "axes that were stopped in a silence are at rest", STOPS_S)


@pytest.mark.clause("AxisDriver/takes-away")
def test_a_servo_goes_off_in_a_silence(streamed: Harness) -> None:
    """Or the call raises, as nothing confirms it: then it is repeated, as a client does."""
    silence_s = silence(streamed)
    streamed.injector.freeze(True)
    streamed.pass_time(silence_s / 2)
    unconfirmed = []
    for axis in streamed.all:
        try:
            streamed.drivers.axes.servo(axis, False, silence_s / 4 / streamed.count)
        except RobotdError:
            unconfirmed.append(axis)
    streamed.injector.freeze(False)
    streamed.pass_time(silence_s)
    for axis in unconfirmed:
        streamed.drivers.axes.servo(axis, False, STOPS_S)
    off = lambda: not streamed.image.servo_on.any()  # noqa: E731
    streamed.until(off, "servos that were switched off in a silence are off", STOPS_S)


def silence(harness: Harness) -> float:
    """Return the length of a silence that costs no connection, s; without an injector: skip."""
    harness.injector.freeze(False)  # else the check is skipped
    return min(LONGEST_S, STALE_SHARE * harness.robot.descriptor.engine.stale_after_s)


@contextmanager
def streaming(
    harness: Harness, velocity: Callable[[float], FloatArray], lead_s: float = RAMP_S + CRUISE_S
) -> Iterator[None]:
    """Stream velocities in the block, which begins after ``lead_s``; wait for rest."""
    axes, driver = harness.robot.axes, harness.drivers.axes
    with axes.claimed("conformance", harness.all):
        with harness.each_period(WaitingStream(harness, velocity)):
            harness.pass_time(lead_s)
            yield
            harness.pass_time(LOOK_S)
        driver.stop(harness.all)
    harness.rest()


def silent_for(harness: Harness, seconds: float) -> MotionSamples:
    """Let no value arrive for a time; return what was seen after that.

    A device that was lost meanwhile skips the check: then nothing continues.
    """
    harness.injector.freeze(True)
    harness.pass_time(seconds)
    harness.injector.freeze(False)
    with harness.recording() as recording:
        harness.pass_time(LOOK_S)
    if not harness.robot.connection.ready or harness.image.offline.any():
        pytest.skip(f"{UNDECIDED}; a silence of {seconds:.3g} s has cost the connection")
    return recording
