"""Problems as messages of ``diagnostic_msgs``: written by the node ``robotd``, read by clients.

A problem is a ``DiagnosticStatus``: the axes are its name, the reason its message, and the rest of
its data are values. Monitors of ROS show it as it is.
"""

from __future__ import annotations

from collections.abc import Sequence

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from robotd.clock import NANOSECONDS
from robotd.control.problem import Problem, ProblemKind

SEPARATOR = ", "  # of axes; their names are names of ROS joints, without spaces


def problem_array(problems: Sequence[Problem], stamp_ns: int, ahead_ns: int) -> DiagnosticArray:
    """Return the message of ``robotd/problems``.

    Args:
        problems: of the robot.
        stamp_ns: ROS time of the message.
        ahead_ns: ROS time minus the robot's clock.
    """
    message = DiagnosticArray(status=[_status(each, ahead_ns) for each in problems])
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, NANOSECONDS)
    return message


def read_problems(message: DiagnosticArray) -> tuple[Problem, ...]:
    """Return the problems of a message; ``since_ns`` is in ROS time."""
    return tuple(map(_problem, message.status))


def _status(problem: Problem, ahead_ns: int) -> DiagnosticStatus:
    values = {
        "kind": str(problem.kind),
        "code": str(problem.code),
        "remedy": problem.remedy,
        "since_ns": str(problem.since_ns + ahead_ns),
    }
    return DiagnosticStatus(
        level=DiagnosticStatus.ERROR if problem.is_fault else DiagnosticStatus.WARN,
        name=SEPARATOR.join(problem.axes),
        message=problem.reason,
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )


def _problem(status: DiagnosticStatus) -> Problem:
    values = {each.key: each.value for each in status.values}
    return Problem(
        ProblemKind(values["kind"]),
        status.message,
        tuple(filter(None, status.name.split(SEPARATOR))),
        int(values["code"]),
        values["remedy"],
        int(values["since_ns"]),
    )
