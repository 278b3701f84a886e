"""Whatever is asked of two joint groups of one robot: neither moves by surprise.

As ``test_any_sequence``, with goals and streams of both groups at the same time. A group whose
drive fails, or whose goal is cancelled, leaves the other one on its path.
"""

from __future__ import annotations

from contextlib import ExitStack
from random import Random

import numpy as np
import pytest
from tests.contract.sequences import Commands, one_of
from tests.contract.test_any_sequence import COMMANDS, PERIODS, ArmPlay
from tests.core.control.harness import arm

from robotd.clock import NANOSECONDS
from robotd.control.loop.setpoint_source import Outcome
from robotd.control.sources.trajectory_execution import TrajectoryExecution
from robotd.motion import TrajectoryRequest

EACH = 3  # joints of a group
GROUPS = {
    "left": {"joints": ["joint1", "joint2", "joint3"]},
    "right": {"joints": ["joint6", "joint5", "joint4"]},  # in an order of its own
}
Points = list[tuple[float, list[float]]]


def points(random: Random) -> Points:
    count = random.randint(1, 3)
    return [
        (random.uniform(0.6, 2.0), [random.uniform(-0.9, 0.9) for _ in range(EACH)])
        for _ in range(count)
    ]


def request(joints: tuple[str, ...], points: Points) -> TrajectoryRequest:
    times_s = np.cumsum([seconds for seconds, _ in points]).tolist()
    return TrajectoryRequest.from_rows(joints, times_s, [row for _, row in points])


# Those of one arm move and fail the joints of the left group; goals and streams are of either.
OF_GROUPS: Commands = {
    "choose": (12, (one_of(*GROUPS),)),
    "pair": (6, (points, points, one_of(0.0, 0.05, 0.3), PERIODS)),
    "one_fails": (
        4,
        (points, points, one_of("trip", "disconnect", "servo", "cancel"), one_of(5, 60, 300)),
    ),
}


class GroupPlay(ArmPlay):
    """Two groups: goals and streams are those of the chosen one."""

    def __init__(self) -> None:
        super().__init__(arm(2 * EACH, groups=GROUPS))
        self._chosen = self.robot.groups["left"]

    def _choose(self, name: str) -> None:
        self._chosen = self.robot.groups[name]

    def _start(self, name: str, points: Points, start_ns: int | None) -> TrajectoryExecution:
        group, goal = self.robot.groups[name], ExitStack()
        asked = request(group.joint_names, points)
        execution = goal.enter_context(group.follower.follow(asked, start_ns=start_ns))
        self.goals.append(goal)
        return execution

    def _goal(self, points: Points, periods: int) -> None:
        self._start(self._chosen.name, points, None)
        self._step(periods)

    def _pair(self, left: Points, right: Points, ahead_s: float, periods: int) -> None:
        start_ns = self.harness.clock.now_ns() + round(ahead_s * NANOSECONDS) if ahead_s else None
        self._start("left", left, start_ns)
        self._start("right", right, start_ns)
        self._step(periods)

    def _open(self, axes: list[int], mode: str, timeout_s: float) -> None:
        names = [self._chosen.joint_names[axis] for axis in axes]
        self.streams.append(self._chosen.stream(names, mode=mode, timeout_s=timeout_s))

    def _one_fails(self, left: Points, right: Points, how: str, periods: int) -> None:
        """Let the left group fail on its way: the right one arrives on its path."""
        self.mend()
        start_ns = self.harness.clock.now_ns() + NANOSECONDS // 10
        slow = [(2.0 * seconds, row) for seconds, row in left]
        failing = self._start("left", slow, start_ns)
        going_on = self._start("right", [(2.0 * seconds, row) for seconds, row in right], start_ns)
        self._step(periods)
        if how == "cancel":
            failing.cancel()
        elif how == "servo":
            self.robot.axes.servo(0, False)
        else:
            self._fault(how, 0)
        axes, farthest = list(self.robot.groups["right"].joint_axes), 0.0
        while not going_on.done:
            self._step(1)
            if not going_on.done and going_on.time_s > 0.0:
                path = going_on.trajectory.evaluate(np.array([going_on.time_s]))[0][0]
                off = np.abs(self.robot.image.setpoint[0, axes] - path).max()
                farthest = max(farthest, float(off))
        assert going_on.outcome is Outcome.SUCCEEDED, going_on.message
        assert failing.outcome in {Outcome.FAULT, Outcome.CANCELED}, failing.message
        assert farthest < 1e-3

    def end(self) -> None:
        """Mend everything; both groups recover, and reach a goal."""
        self.mend()
        home = [(5.0, [0.2] * EACH)]
        for execution in [self._start(name, home, None) for name in GROUPS]:
            self.harness.end(execution)
            assert execution.outcome is Outcome.SUCCEEDED, execution.message


@pytest.mark.parametrize("seed", range(4))
def test_no_group_moves_by_surprise(seed: int) -> None:
    GroupPlay().run(Random(seed), {**COMMANDS, **OF_GROUPS}, 40)
