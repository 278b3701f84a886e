"""Streamed setpoints of one trajectory, without a robot."""

from __future__ import annotations

import numpy as np
import pytest

from robotd.control.completion import Completion
from robotd.control.streamed_trajectory import StreamedTrajectory
from robotd.descriptor.model import TrajectorySettings
from robotd.device.state import Underrun
from robotd.motion import JointLimits, MotionState, TrajectoryRequest, plan

PERIOD_NS = 2_000_000
STALLED = 20  # setpoints before the stall
LIMITS = JointLimits(("a",), np.full(1, -3.0), np.full(1, 3.0), np.full(1, 3.0), np.full(1, 10.0))


@pytest.mark.parametrize("stall_ms", [0, 40, 100, 190])
def test_a_stall_makes_no_jump_in_the_return_of_the_command(stall_ms: int) -> None:
    request = TrajectoryRequest.from_rows(("a",), [1.0], [[0.5]])
    trajectory = plan(request, LIMITS, TrajectorySettings(), MotionState.at_rest(np.zeros(1)))
    source = StreamedTrajectory(trajectory, LIMITS, 0, Underrun.HOLD, Completion())
    measured, time_ns, positions = np.array([-0.1]), 0, []
    while source.return_command(time_ns, measured):
        time_ns += PERIOD_NS
        if len(positions) == STALLED:
            time_ns += stall_ms * 1_000_000
        source.hold(time_ns + PERIOD_NS, PERIOD_NS)
        source.sent(time_ns + PERIOD_NS)
        positions.append(float(source.setpoint[0, 0]))
    speeds = np.diff(positions) / (PERIOD_NS * 1e-9)
    assert np.abs(speeds).max() < LIMITS.velocity[0]
    accelerations = np.diff(speeds[STALLED:]) / (PERIOD_NS * 1e-9)  # in the stall the device holds
    assert np.abs(accelerations).max() < 2.5 * LIMITS.acceleration[0]
    assert positions[-1] == pytest.approx(-0.1, abs=0.02)
