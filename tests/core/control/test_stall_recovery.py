"""Recovery from single and repeated control-loop stalls without jumps of a joint."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.core.control.harness import PERIOD_S, Harness

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS
from robotd.control.loop.setpoint_source import Outcome
from robotd.control.sources.trajectory_execution import TrajectoryExecution
from robotd.errors import NotReady

SWING = ([0.8, -0.6, 0.45], [-0.4, 0.4, 0.2], [0.5, 0.2, -0.3], [0.0, 0.0, 0.0])
SWING_S = 0.8
BACK = 0.1 * 3.0  # rad/s: share of the velocity limit
TICK_S = 0.001


class Drives:
    """Commands of the simulated drives, tick by tick."""

    def __init__(self, harness: Harness) -> None:
        self._harness, self.commands = harness, list[FloatArray]()

    def run(self, seconds: float) -> None:
        world = self._harness.simulation.world
        for _ in range(round(seconds / TICK_S)):
            self._harness.run(TICK_S)
            with world.lock:
                world.advance()
            self.commands.append(self._harness.simulation.servo.command.copy())

    def stall(self, seconds: float) -> None:
        """As ``run``, with the control loop suspended."""
        control_loop = self._harness.robot.control_loop
        self._harness.clock.detach()
        self.run(seconds)
        self._harness.clock.attach(control_loop.period_ns, control_loop.period)

    def finish(self, execution: TrajectoryExecution) -> None:
        while not execution.done:
            self.run(PERIOD_S)

    @property
    def velocity(self) -> FloatArray:
        return np.diff(np.array(self.commands), axis=0) / TICK_S


@pytest.fixture
def harness() -> Iterator[Harness]:
    harness = Harness().up()
    yield harness
    harness.robot.shutdown()


def test_a_goal_is_not_planned_by_an_image_from_before_a_move(harness: Harness) -> None:
    """It would begin with a jump back to where the move began."""
    harness.clock.detach()
    harness.move(0, 2.0)
    text = "the device has sent no values since the last command"
    with pytest.raises(NotReady, match=text), harness.goal((0.5, 0.0, 0.0)):
        pass
    harness.stall(0.1)
    text = "trajectory needs an idle axis, this one is in position"
    with pytest.raises(NotReady, match=text), harness.goal((0.5, 0.0, 0.0)):
        pass
    assert not harness.setpoints.rows


def peak_of(execution: TrajectoryExecution) -> float:
    trajectory = execution.trajectory
    return float(np.abs(trajectory.evaluate(np.arange(0, trajectory.duration_s, 1e-3))[1]).max())


def test_a_missing_setpoint_costs_a_small_deviation(harness: Harness) -> None:
    drives = Drives(harness)
    with harness.goal(*SWING, seconds=SWING_S) as execution:
        drives.run(0.3)
        drives.stall(PERIOD_S)
        drives.finish(execution)
    assert execution.outcome is Outcome.SUCCEEDED
    times_s = harness.setpoints.due_s - execution.start_ns * 1e-9
    planned = execution.trajectory.evaluate(times_s)[0]
    deviation = np.abs(harness.setpoints.position - planned).max(axis=1)
    gap = int(np.argmax(np.diff(times_s))) + 1
    assert deviation[:gap].max() < 1e-9
    assert 1e-6 < deviation.max() < 1e-3
    assert deviation[times_s > times_s[gap] + 0.5].max() < 1e-5, "it is back on its path"


@pytest.mark.parametrize("stall_s", [0.004, 0.01, 0.05, 0.1, 0.2])
@pytest.mark.parametrize("after_s", [0.05, 0.4, 0.75, 2.3, 3.15])
def test_no_joint_jumps_after_a_stall(harness: Harness, stall_s: float, after_s: float) -> None:
    drives = Drives(harness)
    with harness.goal(*SWING, seconds=SWING_S) as execution:
        drives.run(after_s)
        drives.stall(stall_s)
        drives.finish(execution)
    assert np.abs(drives.velocity).max() <= peak_of(execution) + BACK + 0.05
    assert_ended_well(harness, execution)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(st.integers(2, 100), st.integers(2, 120)), min_size=1, max_size=12))
def test_repeated_stalls_do_not_accumulate(stalls: list[tuple[int, int]]) -> None:
    harness = Harness().up()
    drives = Drives(harness)
    with harness.goal(*SWING, seconds=SWING_S) as execution:
        for live_ms, stand_ms in stalls:
            if not execution.done:
                drives.run(live_ms * 1e-3)
                drives.stall(stand_ms // 2 * 2e-3)
        drives.finish(execution)
    assert np.abs(drives.velocity).max() <= peak_of(execution) + BACK + 0.05
    assert_ended_well(harness, execution)
    harness.robot.shutdown()


def test_a_drive_that_holds_continues_from_its_position(harness: Harness) -> None:
    harness.robot.axes.extrapolation_s = 0.0
    with harness.goal(*SWING, seconds=SWING_S) as execution:
        harness.run(0.3)
        harness.stall(0.03)
        harness.end(execution)
    rows = harness.setpoints.rows
    begun = 1 + next(i for i, (one, two) in enumerate(pairwise(rows)) if two[0] - one[0] > 0.01)
    assert rows[begun][1] == pytest.approx(rows[begun - 1][1], abs=1e-4)  # half of a·T²
    assert rows[begun][2] == pytest.approx(0.0, abs=0.05)
    steps = np.abs(np.diff([row[1] for row in rows[begun:]], axis=0)).max() / PERIOD_S
    assert steps <= peak_of(execution) + BACK
    assert_ended_well(harness, execution)


@pytest.mark.parametrize("extrapolation_s", [0.0, 1.5 * PERIOD_S])
def test_the_path_waits_for_drives_that_hold(harness: Harness, extrapolation_s: float) -> None:
    harness.robot.axes.extrapolation_s = extrapolation_s
    target = np.array([0.8, -0.6, 0.45])
    began_ns = harness.clock.now_ns()
    with harness.goal(target.tolist(), seconds=1.0) as execution:
        for _ in range(20):
            harness.run(0.03)
            harness.stall(0.02)
        harness.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED, execution.message
    assert harness.clock.now_ns() - began_ns > (1.0 + 20 * 0.02) * NANOSECONDS
    positions = np.array([row[1] for row in harness.setpoints.rows])
    straight = positions[:, :1] * target / target[0]
    assert positions == pytest.approx(straight, abs=1e-9)
    assert np.diff(positions[:, 0]).min() > -1e-9, "no joint goes back"


def test_a_goal_that_takes_over_recovers_like_the_one_before(harness: Harness) -> None:
    drives = Drives(harness)
    with harness.goal(*SWING, seconds=SWING_S) as first:
        drives.run(0.3)
        drives.stall(0.08)
        drives.run(0.01)
        with harness.goal(*SWING[1:], seconds=1.2) as second:
            drives.finish(second)
    assert first.outcome is Outcome.PREEMPTED
    assert np.abs(drives.velocity).max() <= max(peak_of(first), peak_of(second)) + BACK + 0.05
    assert_ended_well(harness, second)


def assert_ended_well(harness: Harness, execution: TrajectoryExecution) -> None:
    """Assert success, or a fault that states the deviation of a joint."""
    if execution.outcome is not Outcome.SUCCEEDED:
        assert execution.outcome is Outcome.FAULT
        assert "off its path after a control-loop stall of" in execution.message
    else:
        last = harness.setpoints.rows[-1]
        assert last[1] == pytest.approx(execution.trajectory.final_position, abs=1e-5)


def test_a_goal_survives_a_control_loop_that_stalls_most_of_the_time(harness: Harness) -> None:
    """Each stall began where the one before had left the joints: beyond the path, at last."""
    drives = Drives(harness)
    with harness.goal(*SWING, seconds=SWING_S) as execution:
        drives.run(0.4)
        while not execution.done:
            drives.run(0.15)
            drives.stall(0.1)
    assert execution.outcome is Outcome.SUCCEEDED, execution.message
    assert np.abs(drives.velocity).max() <= peak_of(execution) + 0.05


def test_a_stop_ends_where_a_stall_has_left_the_joints(harness: Harness) -> None:
    """They stand: no motion goes on to the end of the stop."""
    drives = Drives(harness)
    with harness.goal(*SWING, seconds=SWING_S) as execution:
        drives.run(0.4)
        execution.cancel()
        drives.run(2 * PERIOD_S)
        assert np.abs(drives.velocity[-1]).max() > 0.1
        drives.stall(0.02)
        stood = drives.commands[-1]
        drives.finish(execution)
    assert execution.outcome is Outcome.CANCELED
    assert drives.commands[-1] == pytest.approx(stood, abs=1e-9)


@pytest.mark.parametrize("stall_s", [0.006, 0.012, 0.03, 0.1])
def test_a_stop_after_a_stall_ends_when_the_joints_stand(harness: Harness, stall_s: float) -> None:
    """The rest of the way back to the path, too slow to be seen, does not delay the result."""
    drives = Drives(harness)
    with harness.goal(*SWING, seconds=SWING_S) as execution:
        drives.run(0.4)
        drives.stall(stall_s)
        went_on = len(drives.commands) - 1  # in the stall they stand, without a ramp
        drives.run(0.004)
        execution.cancel()
        drives.finish(execution)
    assert execution.outcome is Outcome.CANCELED
    moving = (np.abs(drives.velocity) > execution._stopped_velocity).any(axis=1)
    assert (len(moving) - np.flatnonzero(moving)[-1]) * TICK_S < 0.03
    assert np.abs(np.diff(drives.velocity[went_on:], axis=0)).max() < 0.1, "no joint jumps"
