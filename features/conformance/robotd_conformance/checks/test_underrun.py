"""Missing setpoints: a streaming axis behaves as ``AxisDriver.underrun`` says."""

from __future__ import annotations

import numpy as np
import pytest

from robotd.api import EXTRAPOLATION_PERIODS, FloatArray, ProcessImage, Underrun
from robotd_conformance.checks.harness import Harness
from robotd_conformance.checks.recorded_motion import judge, ramped, record_stream

RAMP_S, CRUISE_S, GAP_S = 0.4, 0.1, 0.06
MIN_GAP_PERIODS = 10
SPEED_SHARE = 0.6  # for a distance of at most ``TRAVEL_RAD``
SETTLING_SHARE = 0.5  # of the gap: a device may continue for some periods before it holds
TOLERANCE = 0.25  # of the streamed velocity
PERIODS_TOLERANCE = 0.75  # periods, for the distance without setpoints


class InterruptedStream:
    """Stream setpoints: accelerate, cruise, miss some, and decelerate."""

    def __init__(self, harness: Harness, sign: float) -> None:
        self._harness = harness
        self._start = harness.image.position_command.copy()
        self.velocity = sign * harness.speeds(SPEED_SHARE)
        self._began_ns = 0
        self.gap_s = max(GAP_S, MIN_GAP_PERIODS * harness.period_s)
        self.samples: list[tuple[float, FloatArray]] = []
        self._last_s = 0.0  # of the last setpoint before the gap
        self._stood = self._start
        extrapolates = harness.drivers.axes.underrun is Underrun.EXTRAPOLATE
        self._further_s = EXTRAPOLATION_PERIODS * harness.period_s if extrapolates else 0.0

    @property
    def duration_s(self) -> float:
        return RAMP_S + CRUISE_S + self.gap_s + RAMP_S + 0.1

    def __call__(self, image: ProcessImage) -> None:
        due_ns = self._harness.due_ns
        self._began_ns = self._began_ns or due_ns
        self.samples.append(((image.fresh_ns - self._began_ns) * 1e-9, image.position.copy()))
        state = self._setpoint((due_ns - self._began_ns) * 1e-9)
        if state is not None:
            self._harness.stream(*state)
        else:
            self._stood = image.position_command.copy()

    def slopes(self) -> FloatArray:
        """(n_axes,) mean measured velocity in the later part of the gap."""
        end_s = RAMP_S + CRUISE_S + self.gap_s
        begin_s = end_s - (1.0 - SETTLING_SHARE) * self.gap_s
        inside = [(time_s, row) for time_s, row in self.samples if begin_s < time_s < end_s]
        (first_s, first), (last_s, last) = inside[0], inside[-1]
        return np.asarray((last - first) / (last_s - first_s))

    def periods(self) -> FloatArray:
        """(n_axes,) distance commanded after the last setpoint, in periods at its velocity."""
        distance_s, _ = ramped(self._last_s, RAMP_S, RAMP_S + CRUISE_S + self.gap_s)
        beyond = self._stood - self._start - self.velocity * distance_s
        return np.asarray(beyond / (self.velocity * self._harness.period_s))

    def _setpoint(self, time_s: float) -> tuple[FloatArray, FloatArray] | None:
        """Position and velocity; None in the gap."""
        gap_at_s = RAMP_S + CRUISE_S
        end_s = gap_at_s + self.gap_s
        if gap_at_s <= time_s < end_s:
            return None
        distance_s, share = ramped(time_s, RAMP_S, end_s)
        if time_s < gap_at_s:
            self._last_s = time_s
        else:  # it has stopped in the gap
            (distance_s, _), share = ramped(self._last_s, RAMP_S, end_s), 0.0
            distance_s += self._further_s
        return self._start + self.velocity * distance_s, self.velocity * share


@pytest.mark.clause("AxisDriver.underrun/underrun")
@pytest.mark.short_period
def test_an_axis_without_setpoints_does_what_underrun_says(streamed: Harness) -> None:
    underrun = streamed.drivers.axes.underrun
    wanted = EXTRAPOLATION_PERIODS if underrun is Underrun.EXTRAPOLATE else 0.0
    for sign in (1.0, -1.0):  # and back, in a second stream
        stream = InterruptedStream(streamed, sign)
        recording = record_stream(streamed, stream, stream.duration_s)
        speeds, periods = stream.slopes(), stream.periods()
        problems = [
            f"axis {axis}: goes on with {speeds[axis]:.3g} rad/s without setpoints"
            for axis in streamed.all
            if abs(speeds[axis]) > TOLERANCE * abs(stream.velocity[axis])
        ]
        problems += [
            f"axis {axis}: goes on for {periods[axis]:.2f} periods without setpoints, {underrun}"
            f" means {wanted:g}"
            for axis in streamed.all
            if abs(periods[axis] - wanted) > PERIODS_TOLERANCE
        ]
        judge(streamed, recording, problems)
