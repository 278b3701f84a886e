"""Profiles whose ramps differ from axis to axis, and from one command to the next."""

from __future__ import annotations

import numpy as np

from robotd.api import FloatArray, Profile
from robotd_conformance.checks.harness import Harness
from robotd_conformance.checks.recording import MotionSamples
from robotd_conformance.checks.test_ramps import ramp_problems

HARDEST, GENTLEST = 0.75, 0.3  # shares of the ramp of ``Harness.profile``, and of the hardest
FIRST_TRAVEL, FIRST_SPEED = 0.6, 0.25  # shares of a move that is overridden
AFTER_S = 0.03  # a ramp has ended, and an axis has its speed


def different_ramps(harness: Harness, speed: float, command: int) -> list[Profile]:
    """Profiles of all axes at ``speed`` times their speed, for the ``command``-th of a check.

    The decelerations of any two axes differ. The acceleration of an axis is not its deceleration,
    and is the deceleration of its commands before and after.
    """
    even = [harness.profile(axis, speed) for axis in harness.all]
    return [
        Profile(
            profile.velocity,
            profile.acceleration * _share(harness, axis, command + 1),
            profile.deceleration * _share(harness, axis, command),
        )
        for axis, profile in enumerate(even)
    ]


def ramp_s(profiles: list[Profile]) -> float:
    """Return the time until every axis has the speed of its profile, from rest."""
    return max(abs(profile.velocity) / profile.acceleration for profile in profiles) + AFTER_S


def turn_problems(
    recording: MotionSamples, profiles: list[Profile], before: FloatArray, *, stops: bool
) -> list[str]:
    """Axes with wrong ramps that turn from velocities ``before`` (n_axes,) to the other direction.

    ``stops``: they come to rest in the end, else they keep their velocity.
    """
    ahead = recording.velocity_command * np.sign(before)
    up_to, after = np.maximum(ahead, 0.0), np.maximum(-ahead, 0.0)
    found = ramp_problems(recording, profiles, rising=False, speeds=up_to)
    found += ramp_problems(recording, profiles, falling=stops, speeds=after)
    return [f"{problem}, where it turns" for problem in found]


def _share(harness: Harness, axis: int, command: int) -> float:
    """Share of the ramp, the hardest for axis 0 and even commands."""
    return float(HARDEST * GENTLEST ** ((axis / harness.count + command / 2) % 1.0))
