"""Recorded motions of checks, and verdicts on them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
import pytest

from robotd.api import FloatArray, ProcessImage, Profile
from robotd.api.robots import Jog
from robotd_conformance.checks.harness import Harness
from robotd_conformance.checks.inconclusive import UNDECIDED
from robotd_conformance.checks.recording import MotionSamples


def judge(harness: Harness, recording: MotionSamples, problems: list[str]) -> None:
    """Fail with the ``problems`` of ``recording``, unless values came late: then repeat the check.

    In real time setpoints come late as well, or values do not belong to their times, which is no
    fault of the backend.
    """
    if problems and recording.was_late(harness.feedback_s):
        pytest.skip(f"{UNDECIDED}; seen: {problems[0]}")
    assert not problems, "; ".join(problems)


def record_move(harness: Harness, share: float = 1.0) -> MotionSamples:
    """Move all axes by ``travel``, at ``share`` of their speed, until they are at rest."""
    with harness.recording() as recording:
        harness.move_all(speed=share)
        harness.rest()
    return recording


def there_and_back(harness: Harness) -> Iterator[tuple[int, FloatArray, FloatArray]]:
    """Yield number, start and end (n_axes,) of moves over the travel; the axes rest at start."""
    here = harness.image.position_command.copy()
    there = here + harness.travel()
    for number, (begin, end) in enumerate(((here, there), (there, here))):
        harness.move(harness.all, begin)
        harness.rest()
        yield number, begin, end


def mean_velocity(harness: Harness, seconds: float = 0.1) -> FloatArray:
    """(n_axes,) velocity over ``seconds`` from now, by measured positions and their times."""
    if harness.drivers.axes.feedback_period_s:  # as coarse as a step of an encoder, often
        seconds *= 2.0
    first = harness.image.copy()
    harness.pass_time(seconds)
    last = harness.image.copy()
    return np.asarray((last.position - first.position) / ((last.fresh_ns - first.fresh_ns) * 1e-9))


def sample_span_s(harness: Harness) -> float:
    """Return over how long speeds are measured; in real time, values arrive with a jitter."""
    return 2.0 * harness.period_s if harness.stepped else 3.0 * harness.feedback_s


def jog(harness: Harness, speeds: FloatArray, profiles: Sequence[Profile] | None = None) -> None:
    """Command velocities (n_axes,), with the ramps of ``profiles[axis]``."""
    chosen = profiles or [harness.profile(axis) for axis in harness.all]
    harness.robot.axes.jog(
        [
            Jog(axis, replace(profile, velocity=float(speeds[axis])))
            for axis, profile in enumerate(chosen)
        ]
    )


def record_stream(
    harness: Harness,
    send: Callable[[ProcessImage], None],
    seconds: float,
    axes: Sequence[int] | None = None,
) -> MotionSamples:
    """Call ``send`` in each period for ``seconds``, with ``axes`` (all) claimed; wait for rest."""
    with (
        harness.recording() as recording,
        harness.robot.axes.claimed("conformance", harness.all if axes is None else axes),
        harness.each_period(send),
    ):
        harness.pass_time(seconds)
    harness.rest()
    return recording


def ramped(time_s: float, ramp_s: float, brake_s: float = math.inf) -> tuple[float, float]:
    """Return distance and velocity of a motion at ``time_s``, both per unit of its speed.

    It speeds up for ``ramp_s``, cruises until ``brake_s``, and slows down for ``ramp_s``.
    """
    up_s, down_s = min(time_s, ramp_s), min(max(0.0, time_s - brake_s), ramp_s)
    cruise_s = max(0.0, min(time_s, brake_s) - ramp_s)
    distance_s = up_s**2 / (2.0 * ramp_s) + cruise_s + down_s - down_s**2 / (2.0 * ramp_s)
    return distance_s, (up_s - down_s) / ramp_s


def steep_ramps(
    harness: Harness, recording: MotionSamples, span_s: float, more: float
) -> list[str]:
    """Axes whose velocity command changes faster than ``more`` times their profile's ramp."""
    _, ramps = recording.slope(recording.velocity_command, span_s, commanded=True)
    steepest = abs(ramps).max(0)
    limits = [more * harness.profile(axis).acceleration for axis in harness.all]
    return [
        f"axis {axis}: acceleration {steepest[axis]:.3g} rad/s², the limit is {limits[axis]:.3g}"
        for axis in harness.all
        if steepest[axis] > limits[axis]
    ]
