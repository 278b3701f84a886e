"""Setpoints that the device holds ahead: the driver says that all were executed in motion."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robotd.api import FloatArray, LateSetpoint, ProcessImage, RobotdError
from robotd_conformance.checks.harness import SETTLED_RAD, Harness
from robotd_conformance.checks.recorded_motion import judge, ramped, record_stream
from robotd_conformance.checks.recording import MotionSamples

RAMP_S, CRUISE_S = 0.3, 0.1
STALL_S, MIN_STALL_PERIODS = 0.03, 5  # without setpoints, after the time of those that are held
LATE_S, MIN_LATE_PERIODS = 0.1, 20  # of late setpoints, in which the driver has to say it
UNDERRUN_PERIODS = 1.5  # a longer gap, beyond the buffers, is an underrun for the control loop
MAX_GAP_PERIODS = 4.0  # after a longer one, setpoints are taken again
IGNORED_SHARE = 0.5  # of the distance of the late setpoints
LEAP, LEAP_PERIODS = 2.5, 2  # of the stream's velocity


class StalledStream:
    """Stream that stalls: later setpoints come late, one in each period and none missing.

    The device has executed all that it held by then. Once the driver says so, setpoints come in
    time again, from rest, as those of the control loop would.

    Args:
        harness: all its axes are claimed.
        moving: False: every setpoint is the same.
        stalls: False: all setpoints come in time.

    Attributes:
        failures: what ``stream`` raised last.
        false_reports: number of reports while setpoints came in time.
        reported: dry buffers were reported after the stall.
        velocity: highest, of each axis.
        end: position of the last setpoint.
    """

    def __init__(self, harness: Harness, *, moving: bool, stalls: bool) -> None:
        self._harness, self._axes, self._stalls = harness, harness.drivers.axes, stalls
        self._period_ns = harness.robot.control_loop.period_ns
        period_s, buffer_s = self._period_ns * 1e-9, harness.drivers.axes.stream_buffer_s
        self._resume_s = RAMP_S + CRUISE_S + buffer_s + max(STALL_S, MIN_STALL_PERIODS * period_s)
        self._late_s = buffer_s + max(LATE_S, MIN_LATE_PERIODS * period_s)
        self._underrun_s = buffer_s + UNDERRUN_PERIODS * period_s
        self._max_gap_s = buffer_s + MAX_GAP_PERIODS * period_s
        self._brake_s = RAMP_S + CRUISE_S + self._late_s
        self._start = self.end = harness.image.position_command.copy()
        self.velocity = self._fastest() if moving else np.zeros(harness.count)
        self._began_ns = self._sent_ns = self._late_periods = 0
        self._late_distance = self._went = np.zeros(harness.count)
        self._taken_early = self._ignored_for_good = False
        self.failures: list[str] = []
        self.false_reports = 0
        self.reported = False

    @property
    def duration_s(self) -> float:
        return self._resume_s + self._late_s + 3.0 * RAMP_S

    def __call__(self, image: ProcessImage) -> None:
        due_ns = self._harness.due_ns
        self._began_ns = self._began_ns or due_ns
        time_s = (due_ns - self._began_ns) * 1e-9
        if self.reported or not self._stalls or time_s < RAMP_S + CRUISE_S:
            self.false_reports += self._axes.stream_ran_dry(due_ns)
            self._send(time_s, due_ns)
        elif time_s >= self._resume_s:
            self._send_late(due_ns, image)

    def problems(self) -> list[str]:
        """Return what was wrong with the reports; after the stream."""
        ignored = np.abs(self._went) < IGNORED_SHARE * np.abs(self._late_distance)
        found = {
            "stream_ran_dry said so while setpoints came in time": self.false_reports > 0,
            "late setpoints were ignored, and stream_ran_dry did not say so": not self.reported
            and bool(ignored.any()),
            f"setpoints are taken again within {self._underrun_s:.3f} s, which is not an underrun"
            " for the control loop": self._taken_early,
            f"setpoints are still ignored {self._max_gap_s:.3f} s after the last one": (
                self._ignored_for_good
            ),
        }
        return self.failures + [text for text, true in found.items() if true]

    def _fastest(self) -> FloatArray:
        """Return velocities at which all of the motion stays within the harness' travel."""
        profiles = [self._harness.profile(axis) for axis in self._harness.all]
        highest = [min(profile.velocity, RAMP_S * profile.acceleration) for profile in profiles]
        mean = self._harness.travel() / (self._brake_s + RAMP_S)
        return np.clip(mean, -np.array(highest), highest)

    def _send_late(self, due_ns: int, image: ProcessImage) -> None:
        """Send the next setpoint of the path, as late as the stall was long."""
        if not self._late_periods:
            self._fed_ns, self._stood = self._sent_ns, image.position_command.copy()
        self._late_periods += 1
        late_ns = self._late_periods * self._period_ns
        late_due_ns = self._fed_ns + late_ns
        if not self._send((late_due_ns - self._began_ns) * 1e-9, late_due_ns):
            self.reported = True
            self._start = image.position_command.copy()
            self._brake_s, self._began_ns = RAMP_S, due_ns
        elif late_ns * 1e-9 <= self._late_s:
            self._late_distance = self.velocity * late_ns * 1e-9
            self._went = image.position_command - self._stood

    def _send(self, time_s: float, due_ns: int) -> bool:
        """Send the setpoint of ``time_s``; return False where the driver says it is dry."""
        position, velocity = self._setpoint(time_s)
        if self._axes.stream_ran_dry(due_ns):
            self._ask_ahead()
            return False
        try:
            self._axes.stream(position, velocity, due_ns)
        except LateSetpoint:
            return False
        except RobotdError as error:
            self.failures = [str(error)]
        self.end, self._sent_ns = position, due_ns
        return True

    def _ask_ahead(self) -> None:
        """Ask for the setpoints after the shortest and the longest gap that may be needed."""
        shortest = int(self._underrun_s * 1e9) // self._period_ns
        longest = math.ceil(self._max_gap_s * 1e9 / self._period_ns)
        dry = self._axes.stream_ran_dry
        self._taken_early |= not dry(self._sent_ns + shortest * self._period_ns)
        self._ignored_for_good |= dry(self._sent_ns + longest * self._period_ns)

    def _setpoint(self, time_s: float) -> tuple[FloatArray, FloatArray]:
        """Position and velocity: speed up, cruise until ``_brake_s``, slow down."""
        distance_s, share = ramped(time_s, RAMP_S, self._brake_s)
        return self._start + self.velocity * distance_s, self.velocity * share


def leaps(harness: Harness, recording: MotionSamples, velocity: FloatArray) -> list[str]:
    """Axes whose commands move faster than ``LEAP`` times ``velocity``."""
    span_s = LEAP_PERIODS * harness.feedback_s
    _, speeds = recording.slope(recording.position_command, span_s, commanded=True)
    fastest = np.abs(speeds).max(0)
    return [
        f"axis {axis}: setpoints were ignored without a report, and its command leapt with"
        f" {fastest[axis]:.3g} rad/s"
        for axis in harness.all
        if fastest[axis] > LEAP * abs(velocity[axis])
    ]


def judge_reports(harness: Harness, *, moving: bool, stalls: bool) -> None:
    """Fail where a stream is reported to have run dry."""
    stream = StalledStream(harness, moving=moving, stalls=stalls)
    recording = record_stream(harness, stream, stream.duration_s)
    problems = list(stream.failures)
    if stream.reported or stream.false_reports:
        where = "while setpoints came in time" if moving else "at rest, where any pace will do"
        problems.append(f"stream_ran_dry said so {where}")
    judge(harness, recording, problems)


@pytest.mark.clause("AxisDriver.stream_ran_dry/dry")
def test_a_stream_in_time_is_not_reported_dry(streamed: Harness) -> None:
    judge_reports(streamed, moving=True, stalls=False)


@pytest.mark.clause("AxisDriver.stream_ran_dry/dry")
def test_a_stream_at_rest_is_not_reported_dry(streamed: Harness) -> None:
    judge_reports(streamed, moving=False, stalls=streamed.drivers.axes.stream_buffer_s > 0.0)


@pytest.mark.clause("AxisDriver.stream_ran_dry/dry", "AxisDriver.stream/underrun")
def test_buffers_that_ran_dry_in_motion_are_reported(streamed: Harness) -> None:
    if streamed.drivers.axes.stream_buffer_s == 0.0:
        pytest.skip("the device holds no setpoints ahead (stream_buffer_s is 0)")
    stream = StalledStream(streamed, moving=True, stalls=True)
    recording = record_stream(streamed, stream, stream.duration_s)
    off = np.abs(streamed.image.position_command - stream.end)
    problems = stream.problems() + leaps(streamed, recording, stream.velocity)
    problems += [
        f"axis {axis}: {off[axis]:.4f} rad off the last setpoint"
        for axis in streamed.all
        if off[axis] > SETTLED_RAD
    ]
    judge(streamed, recording, problems)
