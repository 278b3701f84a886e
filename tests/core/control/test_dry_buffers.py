"""A device whose buffers ran dry in motion: the control loop sends nothing, and the path waits."""

from __future__ import annotations

import numpy as np
import pytest
from tests.fakes import FakeAxes, streaming_axes

from robotd.arrays import FloatArray
from robotd.control.groups.descriptor_limits import trajectory_rules
from robotd.control.loop.setpoint_mixer import SetpointMixer
from robotd.control.sources.streamed_trajectory import StreamedTrajectory
from robotd.control.sources.trajectory_execution import PlannedGoal, TrajectoryExecution
from robotd.descriptor.model import TrajectorySettings
from robotd.device.motion_limits import MotionLimits
from robotd.device.process_image import ProcessImage
from robotd.device.state import Operation, Underrun
from robotd.motion import (
    JointLimits,
    JointTolerance,
    MotionState,
    Tolerances,
    TrajectoryRequest,
    plan,
)

PERIOD_NS = 2_000_000
BUFFER_S = 0.01
DRY_NS = 400_000_000  # a setpoint for this time is the last one before
GAP_NS = round(BUFFER_S * 1e9) + 3 * PERIOD_NS // 2  # a longer one is an underrun
MISSED = GAP_NS // PERIOD_NS
LIMITS = JointLimits(("a",), *(np.array([value]) for value in (-3.0, 3.0, 3.0, 10.0)))
RULES = trajectory_rules(TrajectorySettings(), LIMITS.units)


class DryAxes(FakeAxes):
    """Ignores setpoints from ``DRY_NS`` until there is a gap."""

    underrun = Underrun.HOLD
    stream_buffer_s = BUFFER_S

    def __init__(self) -> None:
        super().__init__(1)
        self.sent: list[tuple[int, float, float]] = []

    def stream_ran_dry(self, due_ns: int) -> bool:
        return DRY_NS < due_ns <= DRY_NS + GAP_NS

    def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
        self.sent.append((due_ns, float(position[0]), float(velocity[0])))


def half_a_radian(start_ns: int) -> TrajectoryExecution:
    request = TrajectoryRequest.from_rows(("a",), [1.0], [[0.5]])
    path = plan(request, LIMITS, RULES, MotionState.at_rest(np.zeros(1)))
    goal = PlannedGoal(
        path,
        np.array([0]),
        LIMITS,
        Tolerances(LIMITS, RULES, (), [JointTolerance("a", -1.0)]),
        RULES.stopped_velocity,
    )
    axes = streaming_axes(0.0, BUFFER_S)
    return StreamedTrajectory(axes, MotionLimits(), goal, start_ns)


def test_the_path_waits_while_the_buffers_are_dry() -> None:
    axes, image = DryAxes(), ProcessImage(1)
    image.servo_on[:], image.offline[:], image.operation[:] = True, False, Operation.STREAM
    mixer = SetpointMixer(axes, 1, 1e9 / PERIOD_NS)
    slot = mixer.slot()
    slot.select(0)
    assert slot.submit(half_a_radian(slot.next_start_ns), None)
    for time_ns in range(0, 600_000_001, PERIOD_NS):
        image.position[:] = axes.sent[-1][1] if axes.sent else 0.0
        image.velocity[:] = axes.sent[-1][2] if axes.sent else 0.0
        mixer.advance(time_ns, image)
    before = [setpoint for setpoint in axes.sent if setpoint[0] <= DRY_NS]
    after = [setpoint for setpoint in axes.sent if setpoint[0] > DRY_NS]
    assert after[0][0] == DRY_NS + (MISSED + 1) * PERIOD_NS
    assert mixer.stats.late_setpoints == MISSED
    assert before[-1][2] > 0.5
    assert after[0][1] == pytest.approx(before[-1][1], abs=1e-4)
    speeds = np.array([0.0] + [velocity for _, _, velocity in after])
    assert np.diff(speeds).max() <= 1.01 * LIMITS.acceleration[0] * PERIOD_NS * 1e-9
