"""Trajectories back to back: to the end, canceled, preempted, and bad ones."""

from __future__ import annotations

import random
import threading
from collections import Counter
from typing import Any

from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from tests.ros.action_client import GoalClient
from tests.ros.robot_process import WAIT_S, Client, wait_for, wait_until
from trajectory_msgs.msg import JointTrajectoryPoint

from robotd.descriptor import RobotDescriptor

REACH_RAD = 0.4
SHORTEST_S, LONGEST_S = 2.6, 5.0  # within the acceleration limits from any start
MOST_POINTS = 50
CANCEL, PREEMPT, BAD, PAUSE = 0.2, 0.2, 0.05, 0.2  # shares of the goals
WORDS = {GoalStatus.STATUS_SUCCEEDED: "succeeded", GoalStatus.STATUS_CANCELED: "canceled"}


class Goals:
    """Sends goals at random, one after the other.

    Counts ``goals``, ``results``, each outcome, and ``unexpected`` ones with their reason.
    """

    def __init__(
        self,
        client: Client,
        descriptor: RobotDescriptor,
        counts: Counter[str],
        chance: random.Random,
        rate_hz: float = 0.0,
    ) -> None:
        parameters = descriptor.ros_parameters["follow_joint_trajectory_server"]
        action = f"/{parameters['joint_trajectory_action']}"
        self._actions = GoalClient(client.node, FollowJointTrajectory, action)
        self._joints = [joint.name for joint in descriptor.joints]
        self._counts, self._chance = counts, chance

    def run(self, ended: threading.Event) -> None:
        assert self._actions.wait_for_server(WAIT_S), "no action"
        while not ended.is_set():
            self._send(ended)
        wait_until(self._all_ended, "results of all goals")

    def _all_ended(self) -> bool:
        return self._counts["goals"] == self._counts["results"]

    def _send(self, ended: threading.Event) -> None:
        chance, counts = self._chance, self._counts
        seconds = chance.uniform(SHORTEST_S, LONGEST_S)
        fate, is_bad = chance.random(), chance.random() < BAD
        counts["goals"] += 1
        goal = bad_goal(self._joints) if is_bad else random_goal(self._joints, seconds, chance)
        handle = wait_for(self._actions.send_goal_async(goal, lambda _: None))
        result = handle.get_result_async()
        result.add_done_callback(lambda future: self._ended(future.result(), is_bad=is_bad))
        if fate < CANCEL + PREEMPT:
            ended.wait(chance.uniform(0.0, seconds))
            if fate < CANCEL:
                wait_for(handle.cancel_goal_async())
                wait_for(result)
            return  # the next one takes over
        wait_for(result)
        if chance.random() < PAUSE:
            ended.wait(chance.uniform(0.0, 1.0))

    def _ended(self, answer: Any, *, is_bad: bool) -> None:
        text = answer.result.error_string
        word = WORDS.get(answer.status)
        if answer.status == GoalStatus.STATUS_ABORTED:
            word = "preempted" if "preempted" in text else "goal rejected" if is_bad else None
        self._counts[word or "unexpected"] += 1
        if word is None:
            self._counts[f"unexpected {answer.status}: {text}"] += 1
        self._counts["results"] += 1


def random_goal(joints: list[str], seconds: float, chance: random.Random) -> Any:
    """A goal of 1 to ``MOST_POINTS`` points, to a target at random in ``seconds``."""
    count = chance.choice((1, 2, 10, MOST_POINTS))
    start, end = ([chance.uniform(-REACH_RAD, REACH_RAD) for _ in joints] for _ in range(2))
    # The first half is for the motion from wherever the arm is.
    points = [(seconds / 2.0, start)]
    for number in range(1, count):
        part = number / (count - 1)
        reached = [a + (b - a) * 0.3 * part for a, b in zip(start, end, strict=True)]
        points.append((seconds * (0.5 + part / 2.0), reached))
    return goal_of(joints, points)


def bad_goal(joints: list[str]) -> Any:
    """A goal beyond every limit."""
    return goal_of(joints, [(1.0, [100.0] * len(joints))])


def goal_of(joints: list[str], points: list[tuple[float, list[float]]]) -> Any:
    """A goal through ``points``: seconds from the start, and positions in rad."""
    goal = FollowJointTrajectory.Goal()
    goal.trajectory.joint_names = joints
    for time_s, positions in points:
        seconds, nanoseconds = divmod(round(time_s * 1e9), 10**9)
        point = JointTrajectoryPoint(positions=positions)
        point.time_from_start = Duration(sec=seconds, nanosec=nanoseconds)
        goal.trajectory.points.append(point)
    return goal
