"""Problems as messages of ``diagnostic_msgs``: written by the node ``robotd``, read by clients.

A problem is a ``DiagnosticStatus``: the axes are its name, the reason its message, and the rest of
its data are values. Monitors of ROS show it as it is.
"""

from __future__ import annotations

from collections.abc import Sequence

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from robotd.clock import NANOSECONDS
from robotd.control.groups.problem import Problem, ProblemKind

SEPARATOR = ", "  # of axes; their names are names of ROS joints, without spaces


def problem_array(problems: Sequence[Problem], stamp_ns: int, ahead_ns: int) -> DiagnosticArray:
    """Return the message of ``robotd/problems``.

    Args:
        stamp_ns: ROS time of the message.
        ahead_ns: ROS time minus the robot's clock.
    """
    message = DiagnosticArray()
    for problem in problems:
        values = {
            "kind": str(problem.kind),
            "code": str(problem.code),
            "remedy": problem.remedy,
            "since_ns": str(problem.since_ns + ahead_ns),
        }
        message.status.append(
            DiagnosticStatus(
                level=DiagnosticStatus.ERROR if problem.is_fault else DiagnosticStatus.WARN,
                name=SEPARATOR.join(problem.axes),
                message=problem.reason,
                values=[KeyValue(key=key, value=value) for key, value in values.items()],
            )
        )
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, NANOSECONDS)
    return message


def read_problems(message: DiagnosticArray) -> tuple[Problem, ...]:
    """Return the problems of a message; ``since_ns`` is in ROS time."""
    found = []
    for status in message.status:
        values = {value.key: value.value for value in status.values}
        axes = tuple(filter(None, status.name.split(SEPARATOR)))
        code, since_ns = int(values["code"]), int(values["since_ns"])
        kind = ProblemKind(values["kind"])
        found.append(Problem(kind, status.message, axes, code, values["remedy"], since_ns))
    return tuple(found)
