"""Moves of axes by hand, and the first motion after them."""

from __future__ import annotations

import numpy as np

from robotd.api import FaultInjector, FloatArray
from robotd_conformance.checks.harness import Harness
from robotd_conformance.checks.recorded_motion import judge


def small_distances(harness: Harness, size: float) -> FloatArray:
    """Return (n_axes,) distances from ``size`` to twice that, all different."""
    return np.asarray(size * np.sign(harness.travel()) * np.linspace(1.0, 2.0, harness.count))


def move_by_hand(harness: Harness, injector: FaultInjector, delta: FloatArray) -> None:
    """Move each axis by ``delta`` (n_axes,); one of 0 is left alone."""
    for axis in np.flatnonzero(delta).tolist():
        injector.move_by_hand(axis, float(delta[axis]))


def require_smooth_begin(harness: Harness) -> None:
    """Move; raise AssertionError where the command jumps to another begin, or arrives elsewhere."""
    with harness.recording() as recording:
        targets = harness.move_all(0.1)
        harness.rest()
    assert not harness.off_target(targets)
    steps = np.abs(np.diff(recording.position_command, axis=0))
    fastest = (steps / np.diff(recording.time_s)[:, None]).max(0)
    problems = [
        f"axis {axis}: the command of a move after one by hand changes by {fastest[axis]:.3g} rad/s"
        for axis in harness.all
        if fastest[axis] > 2 * harness.profile(axis).velocity
    ]
    judge(harness, recording, problems)
