"""Timed motions for checks, repeated on a busy computer."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from robotd.device.process_image import ProcessImage
from robotd.testing.conformance.harness import Harness
from robotd.testing.conformance.recording import Recording

ATTEMPTS = 3


def judge(
    harness: Harness, motion: Callable[[], Recording], problems: Callable[[Recording], list[str]]
) -> None:
    """Run ``motion``; what ``problems`` finds in its recording is a failure.

    In real time it is tried again when the control loop or the device's values came late: then
    setpoints came late, or values do not belong to their times, which is no fault of the backend.
    """
    for _ in range(ATTEMPTS):
        recording = motion()
        found = problems(recording)
        if not (found and recording.was_late(harness.feedback_s)):
            assert not found, "; ".join(found)
            return
    pytest.skip(f"the computer was too busy to judge: values were late {ATTEMPTS} times")


def record_stream(
    harness: Harness, send: Callable[[ProcessImage], None], seconds: float
) -> Recording:
    """Call ``send`` in each period for ``seconds``, with all axes claimed; then wait for rest."""
    with (
        harness.recording() as recording,
        harness.robot.axes.claimed("conformance", harness.all),
        harness.each_period(send),
    ):
        harness.pass_time(seconds)
    harness.rest()
    return recording


def steep_ramps(harness: Harness, recording: Recording, span_s: float, more: float) -> list[str]:
    """Axes whose velocity command changes faster than ``more`` times their profile's ramp."""
    _, ramps = recording.slope(recording.velocity_command, span_s)
    steepest = abs(ramps).max(0)
    limits = [more * harness.profile(axis).acceleration for axis in harness.all]
    return [
        f"axis {axis}: acceleration {steepest[axis]:.3g} rad/s², the limit is {limits[axis]:.3g}"
        for axis in harness.all
        if steepest[axis] > limits[axis]
    ]
