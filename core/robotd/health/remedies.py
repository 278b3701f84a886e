"""Remedies for the problems that the page shows, from the tables of ``robotd explain CODE``."""

from __future__ import annotations

from functools import cache

from robotd.control.problem import Problem, ProblemKind
from robotd.plugin.code_table import CodeTable, load_code_tables
from robotd.robot import Robot

GENERAL = {
    ProblemKind.DEVICE: "Check the power and the cables of the device, then: robotd recover",
    ProblemKind.CONTROLLER: "Remove the cause, then: robotd recover",
    ProblemKind.ALARM: "Remove the cause, then: robotd recover",
    ProblemKind.OFFLINE: "Check the power and the cable of the drive, then: robotd recover",
    ProblemKind.SERVO_OFF: "To switch it on: robotd servo on",
    ProblemKind.STOPPED: "When it is safe to move: robotd reset",
    ProblemKind.OUTSIDE_LIMITS: "Jog it back inside, or correct its position or its limits",
}


def remedy(robot: Robot, problem: Problem) -> str:
    """Return what to do about a problem; "" where nothing has to be done."""
    for table in backend_tables(robot):
        if problem.kind is ProblemKind.ALARM and (advice := table.advice(problem.code)):
            return f"{advice}, then: robotd recover"
    return GENERAL.get(problem.kind, "")


def backend_tables(robot: Robot) -> list[CodeTable]:
    """Return the code tables of the robot's backend; imported at the first call."""
    return _tables(robot.backend.origin.module.partition(".")[0])


@cache
def _tables(package: str) -> list[CodeTable]:
    return load_code_tables(package)[0]
