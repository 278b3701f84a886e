"""Summary of a robot, for lists of several: state, problems, owners."""

from __future__ import annotations

from typing import Any

from robotd.control.problem import ProblemKind
from robotd.robot import Robot

MAX_PROBLEMS = 8
READY = "ready"
# The first of these kinds that a robot has is its state.
STATES = {
    ProblemKind.ENDING: "shutting down",
    ProblemKind.STARTING: "starting",
    ProblemKind.DEVICE: "no device",
    ProblemKind.CONTROLLER: "fault",
    ProblemKind.ALARM: "fault",
    ProblemKind.OFFLINE: "fault",
    ProblemKind.STOPPED: "stopped",
    ProblemKind.SERVO_OFF: "servo off",
}


def robot_summary(robot: Robot) -> dict[str, Any]:
    """Return what changes in a list of robots, as JSON. Any thread.

    ``state`` is "ready" or one of ``STATES``; ``problems`` are texts, the root cause first;
    ``owners`` names the clients that move axes.
    """
    problems = robot.find_problems()
    kinds = {problem.kind for problem in problems}
    found = next((text for kind, text in STATES.items() if kind in kinds), READY)
    state = found if found != READY or robot.connection.ready else STATES[ProblemKind.DEVICE]
    axes = robot.axes
    owners = {axes.owner(axis) for axis in range(len(axes))} - {""}
    return {
        "state": state,
        "problems": [problem.text for problem in problems[:MAX_PROBLEMS]],
        "owners": sorted(owners),
    }
