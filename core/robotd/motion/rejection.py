"""Rejection of a trajectory before anything moves, and the numbers in its text."""

from __future__ import annotations

from enum import IntEnum

from robotd.errors import InvalidArgument


class RejectionCode(IntEnum):
    """Kinds of a rejection; ROS clients of actions get these numbers."""

    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3


class TrajectoryRejected(InvalidArgument):
    """Rejection of a trajectory; the text names joint, time, value and limit."""

    code: RejectionCode

    def __init__(self, code: RejectionCode, message: str) -> None:
        super().__init__(message, code=code)


def reject(message: str) -> TrajectoryRejected:
    """Return an ``INVALID_GOAL`` rejection, to be raised."""
    return TrajectoryRejected(RejectionCode.INVALID_GOAL, message)


def reject_joints(message: str) -> TrajectoryRejected:
    """Return an ``INVALID_JOINTS`` rejection, to be raised."""
    return TrajectoryRejected(RejectionCode.INVALID_JOINTS, message)


_MAX_DIGITS = 17  # distinguish any two doubles


def distinct(value: float, limit: float, digits: int = 5) -> tuple[str, str]:
    """Format two numbers with ``digits`` significant digits, or more until the texts differ.

    Equal numbers keep ``digits``; 0 has no sign. NaN and inf are written as such.
    """
    value, limit = value + 0.0, limit + 0.0  # of -0.0 that is 0.0
    texts = f"{value:.{digits}g}", f"{limit:.{digits}g}"
    more = range(digits + 1, _MAX_DIGITS + 1) if value != limit else ()
    for count in more:
        if texts[0] != texts[1]:
            break
        texts = f"{value:.{count}g}", f"{limit:.{count}g}"
    return texts
