"""A cycle that stands still for a while, once and again: no joint leaps, and all end well."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.unit.cycle.rig import PERIOD_S, Rig

from robotd.arrays import FloatArray
from robotd.cycle.execution import Execution, Outcome

SWING = ([0.8, -0.6, 0.45], [-0.4, 0.4, 0.2], [0.5, 0.2, -0.3], [0.0, 0.0, 0.0])
SWING_S = 0.8
BACK = 0.1 * 3.0  # rad/s: share of the velocity limit
TICK_S = 0.001


class Drives:
    """Commands of the simulated drives, tick by tick."""

    def __init__(self, rig: Rig) -> None:
        self._rig, self.commands = rig, list[FloatArray]()

    def live(self, seconds: float) -> None:
        world = self._rig.simulation.world
        for _ in range(round(seconds / TICK_S)):
            self._rig.run(TICK_S)
            with world.lock:
                world.advance()
            self.commands.append(self._rig.simulation.servo.command.copy())

    def stand(self, seconds: float) -> None:
        """As ``live``, but for the cycle."""
        cycle = self._rig.robot.cycle
        self._rig.clock.detach()
        self.live(seconds)
        self._rig.clock.attach(cycle.period_ns, cycle.period)

    def finish(self, execution: Execution) -> None:
        while not execution.done:
            self.live(PERIOD_S)

    @property
    def velocity(self) -> FloatArray:
        return np.diff(np.array(self.commands), axis=0) / TICK_S


@pytest.fixture
def rig() -> Iterator[Rig]:
    rig = Rig().up()
    yield rig
    rig.robot.shutdown()


def peak_of(execution: Execution) -> float:
    trajectory = execution.trajectory
    return float(np.abs(trajectory.evaluate(np.arange(0, trajectory.duration_s, 1e-3))[1]).max())


def test_a_short_stall_costs_setpoints_and_a_small_deviation(rig: Rig) -> None:
    drives = Drives(rig)
    with rig.goal(*SWING, seconds=SWING_S) as execution:
        drives.live(0.3)
        drives.stand(0.03)
        drives.finish(execution)
    assert execution.outcome is Outcome.SUCCEEDED
    times_s = rig.setpoints.due_s - execution.start_ns * 1e-9
    planned = execution.trajectory.evaluate(times_s)[0]
    deviation = np.abs(rig.setpoints.position - planned).max(axis=1)
    gap = int(np.argmax(np.diff(times_s))) + 1
    assert deviation[:gap].max() < 1e-9
    assert 1e-5 < deviation.max() < 0.01
    assert deviation[times_s > times_s[gap] + 0.5].max() < 1e-5, "it is back on its path"


@pytest.mark.parametrize("stall_s", [0.004, 0.01, 0.05, 0.1, 0.2])
@pytest.mark.parametrize("after_s", [0.05, 0.4, 0.75, 2.3, 3.15])
def test_no_joint_leaps_after_a_stall(rig: Rig, stall_s: float, after_s: float) -> None:
    drives = Drives(rig)
    with rig.goal(*SWING, seconds=SWING_S) as execution:
        drives.live(after_s)
        drives.stand(stall_s)
        drives.finish(execution)
    assert np.abs(drives.velocity).max() <= peak_of(execution) + BACK + 0.05
    assert_ended_well(rig, execution)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(st.integers(2, 100), st.integers(2, 120)), min_size=1, max_size=12))
def test_stall_upon_stall_does_not_feed_on_itself(stalls: list[tuple[int, int]]) -> None:
    rig = Rig().up()
    drives = Drives(rig)
    with rig.goal(*SWING, seconds=SWING_S) as execution:
        for live_ms, stand_ms in stalls:
            if not execution.done:
                drives.live(live_ms * 1e-3)
                drives.stand(stand_ms // 2 * 2e-3)
        drives.finish(execution)
    assert np.abs(drives.velocity).max() <= peak_of(execution) + BACK + 0.05
    assert_ended_well(rig, execution)
    rig.robot.shutdown()


def test_a_drive_that_stands_starts_where_it_stands(rig: Rig) -> None:
    rig.follower._execution = partial(Execution, goes_on=False)
    with rig.goal(*SWING, seconds=SWING_S) as execution:
        rig.run(0.3)
        rig.stall(0.03)
        rig.end(execution)
    rows = rig.setpoints.rows
    begun = 1 + next(i for i, (one, two) in enumerate(pairwise(rows)) if two[0] - one[0] > 0.01)
    assert rows[begun][1] == pytest.approx(rows[begun - 1][1])
    assert rows[begun][2] == pytest.approx(0.0)
    steps = np.abs(np.diff([row[1] for row in rows[begun:]], axis=0)).max() / PERIOD_S
    assert steps <= peak_of(execution) + BACK
    assert_ended_well(rig, execution)


def test_a_goal_that_takes_over_leaps_no_more_than_the_one_before(rig: Rig) -> None:
    drives = Drives(rig)
    with rig.goal(*SWING, seconds=SWING_S) as first:
        drives.live(0.3)
        drives.stand(0.08)
        drives.live(0.01)
        with rig.goal(*SWING[1:], seconds=1.2) as second:
            drives.finish(second)
    assert first.outcome is Outcome.PREEMPTED
    assert np.abs(drives.velocity).max() <= max(peak_of(first), peak_of(second)) + BACK + 0.05
    assert_ended_well(rig, second)


def assert_ended_well(rig: Rig, execution: Execution) -> None:
    """At the goal, or stopped for a reason that says how far off a joint was."""
    if execution.outcome is not Outcome.SUCCEEDED:
        assert execution.outcome is Outcome.FAULT
        assert "off its path after the cycle had stood for" in execution.message
    else:
        last = rig.setpoints.rows[-1]
        assert last[1] == pytest.approx(execution.trajectory.final_position, abs=1e-5)
