"""Recorded motions of devices whose values arrive slower than control periods begin."""

from __future__ import annotations

import pytest

from robotd.api import ProcessImage
from robotd_conformance.checks.inconclusive import STALL_S
from robotd_conformance.checks.kit_target import KitTarget
from robotd_conformance.checks.recording import MotionSamples

PERIOD_S, FEEDBACK_S, RAMP = 0.005, 0.01, 4.0


def recorded(*, slow: bool, pause_s: float = 0.0) -> MotionSamples:
    """A velocity command that rises by ``RAMP``; every second exchange takes 6 ms more."""
    recording, image = MotionSamples(PERIOD_S, slow=slow), ProcessImage(1)
    now_s, exchanges = 1.0, 0
    for period in range(80):
        now_s += PERIOD_S + (pause_s if period == 40 else 0.0)
        while 1.0 + (exchanges + 1) * FEEDBACK_S + (0.007 if exchanges % 2 else 0.001) <= now_s:
            exchanges += 1
        fresh_s = 1.0 + exchanges * FEEDBACK_S
        image.stamp_ns, image.fresh_ns = round(now_s * 1e9), round(fresh_s * 1e9)
        image.velocity_command[0] = RAMP * now_s
        recording.add(image)
    return recording


def test_ramps_of_commands_are_measured_by_the_time_of_the_commands() -> None:
    recording = recorded(slow=True)
    _, ramps = recording.slope(recording.velocity_command, 0.02, commanded=True)
    assert ramps == pytest.approx(RAMP)
    _, ramps = recording.slope(recording.velocity_command, FEEDBACK_S)
    assert abs(ramps - RAMP).max() > 0.15 * RAMP, "the time of the values is another one"


def test_a_pause_of_the_control_loop_is_late_although_values_came_in_time() -> None:
    assert not recorded(slow=True).was_late(FEEDBACK_S)
    assert recorded(slow=True, pause_s=0.8 * PERIOD_S).was_late(FEEDBACK_S)


def test_a_short_stall_explains_a_failure_of_axes_that_come_to_rest_in_it() -> None:
    assert KitTarget("sim", "so101").stall_s == STALL_S
    assert KitTarget("dynamixel", "omx").stall_s == PERIOD_S
