"""The client that behaves, and what it says of the robot meanwhile and afterwards."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from action_msgs.msg import GoalStatus
from std_srvs.srv import Trigger
from tests.ros.robot_process import Client, wait_until
from tools.endurance.goals import goal_of
from tools.endurance.lives import JOINTS

SWING_RAD, SWING_S = 0.2, 1.0
FASTEST_RAD_S = 1.2  # twice the peak of a swing from one side to the other: there was no jump
STATUS = "/wmx/engine/get_status"


def swing(client: Client, number: int) -> str:
    """A goal to one side or the other; why it failed, empty when it did not."""
    target = SWING_RAD if number % 2 else -SWING_RAD
    goal = goal_of(JOINTS, [(SWING_S, [target] * len(JOINTS))])
    try:
        status, result = client.send_goal(goal).result()
    except AssertionError as error:
        return str(error)
    return "" if status == GoalStatus.STATUS_SUCCEEDED else str(result.error_string)


def afterwards(client: Client) -> str:
    """Return the services that fail; empty when all work."""
    answer = client.call(Trigger, STATUS)
    if answer.message != "Communicating":
        return f"the engine is {answer.message}"
    failure = ""

    def moves() -> bool:  # an old goal of others may still take over from ours
        nonlocal failure
        failure = swing(client, 1)
        return not failure

    try:
        wait_until(moves, "an ordinary goal")
    except AssertionError:
        return f"an ordinary goal fails: {failure}"
    return ""


def lateness_us(report: Path, began_ns: int, ended_ns: int) -> tuple[float, float, float]:
    """Median, 99th percentile and largest of the periods in a window of monotonic time.

    Args:
        report: what ``robotd run --report`` wrote; it has the last 8192 periods.
        began_ns, ended_ns: the window.
    """
    samples = json.loads(report.read_text(encoding="utf-8"))["samples"]
    start = np.array(samples["start_ns"])
    inside = (start >= began_ns) & (start <= ended_ns)
    lateness = np.array(samples["lateness_ns"])[inside] / 1000.0
    p50, p99, top = np.percentile(lateness, (50, 99, 100)) if len(lateness) else [np.nan] * 3
    return round(float(p50), 1), round(float(p99), 1), round(float(top), 1)
