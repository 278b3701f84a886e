"""Streamed setpoints of one trajectory, without a robot."""

from __future__ import annotations

import numpy as np
import pytest
from tests.fakes import streaming_axes

from robotd.control.groups.descriptor_limits import trajectory_rules
from robotd.control.loop.setpoint_source import Outcome
from robotd.control.sources.streamed_trajectory import StreamedTrajectory
from robotd.control.sources.trajectory_execution import PlannedGoal
from robotd.descriptor.model import TrajectorySettings
from robotd.device.motion_limits import MotionLimits
from robotd.device.process_image import ProcessImage
from robotd.device.state import Operation
from robotd.motion import (
    JointLimits,
    JointTolerance,
    MotionState,
    Tolerances,
    TrajectoryRequest,
    plan,
)

PERIOD_NS = 2_000_000
STALLED = 20  # setpoints before the stall
LIMITS = JointLimits(("a",), np.full(1, -3.0), np.full(1, 3.0), np.full(1, 3.0), np.full(1, 10.0))
RULES = trajectory_rules(TrajectorySettings(), LIMITS.units)
DEVIATION = 0.03  # of a device's commands from the setpoints


def half_a_radian(tolerances: Tolerances | None = None) -> PlannedGoal:
    request = TrajectoryRequest.from_rows(("a",), [1.0], [[0.5]])
    path = plan(request, LIMITS, RULES, MotionState.at_rest(np.zeros(1)))
    tolerances = tolerances or Tolerances(LIMITS, RULES)
    stopped = RULES.stopped_velocity
    return PlannedGoal(path, np.array([0]), LIMITS, tolerances, stopped)


def streamed(goal: PlannedGoal, buffer_s: float = 0.0) -> StreamedTrajectory:
    return StreamedTrajectory(streaming_axes(0.0, buffer_s), MotionLimits(), goal, 0)


@pytest.mark.parametrize("stall_ms", [0, 40, 100, 190])
def test_a_stall_makes_no_jump_in_the_return_of_the_command(stall_ms: int) -> None:
    source = streamed(half_a_radian())
    offset, time_ns, positions = np.array([-0.1]), 0, []
    while source._return_command(time_ns, offset):
        time_ns += PERIOD_NS
        if len(positions) == STALLED:
            time_ns += stall_ms * 1_000_000
        source._hold(time_ns + PERIOD_NS, PERIOD_NS, ProcessImage(1))
        source.sent(time_ns + PERIOD_NS)
        positions.append(float(source.setpoint[0, 0]))
    speeds = np.diff(positions) / (PERIOD_NS * 1e-9)
    assert np.abs(speeds).max() < LIMITS.velocity[0]
    accelerations = np.diff(speeds[STALLED:]) / (PERIOD_NS * 1e-9)  # in the stall the device holds
    assert np.abs(accelerations).max() < 2.5 * LIMITS.acceleration[0]
    assert positions[-1] == pytest.approx(-0.1, abs=0.02)


@pytest.mark.parametrize("buffer_s", [0.0, 0.01])
def test_the_time_of_feedback_is_that_of_the_desired_values_after_a_stall(buffer_s: float) -> None:
    tolerances = Tolerances(LIMITS, RULES, (), [JointTolerance("a", -1.0)])
    goal = half_a_radian(tolerances)
    execution = streamed(goal, buffer_s)
    image, time_ns, periods = ProcessImage(1), 0, 0
    image.servo_on[:], image.offline[:], image.operation[:] = True, False, Operation.STREAM
    while not execution.done:
        periods += 1
        time_ns += PERIOD_NS if periods % 100 else 50_000_000
        image.position[:], image.velocity[:] = execution.setpoint[:2, 0]
        assert execution.advance(time_ns, PERIOD_NS, image)
        execution.sent(time_ns + PERIOD_NS)
        progress = execution.progress()
        planned = execution.trajectory.evaluate(np.array([progress.time_s]))[0][0]
        assert progress.desired_position == pytest.approx(planned, abs=1e-9)
    assert execution.outcome is Outcome.SUCCEEDED, execution.message


def test_no_return_to_a_joint_that_follows_a_deviating_command() -> None:
    """The WMX engine's commands deviate after an underrun of its buffers."""
    tolerances = Tolerances(LIMITS, RULES, (), [JointTolerance("a", 0.01)], 0.1)
    execution = streamed(half_a_radian(tolerances))
    image, time_ns = ProcessImage(1), 0
    image.servo_on[:], image.offline[:], image.operation[:] = True, False, Operation.STREAM
    while not execution.done:
        time_ns += PERIOD_NS
        image.fresh_ns = time_ns
        image.position[:] = image.position_command[:] = execution.setpoint[0] - DEVIATION
        assert execution.advance(time_ns, PERIOD_NS, image)
        execution.sent(time_ns + PERIOD_NS)
    assert execution.outcome is Outcome.GOAL_TOLERANCE, execution.message
    assert execution.setpoint[:2] == pytest.approx(np.array([[0.5], [0.0]]))


@pytest.mark.parametrize("buffer_s", [0.0, 0.02])
@pytest.mark.parametrize("late_ms", [0.0, 0.5, 2.0, 20.0, 200.0])
def test_the_first_setpoint_is_a_period_ahead_on_the_path(late_ms: float, buffer_s: float) -> None:
    """Nothing bridges the time before it: the joints rest until then."""
    execution = streamed(half_a_radian(), buffer_s)
    image, time_ns = ProcessImage(1), round(late_ms * 1e6)
    image.servo_on[:], image.offline[:], image.operation[:] = True, False, Operation.STREAM
    assert execution.advance(time_ns, PERIOD_NS, image)
    path = execution.trajectory.evaluate(np.array([PERIOD_NS * 1e-9]))
    np.testing.assert_allclose(execution.setpoint[:2], [path[0][0], path[1][0]], atol=1e-12)
