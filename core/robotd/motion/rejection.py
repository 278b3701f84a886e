"""Rejection of a trajectory before anything moves."""

from __future__ import annotations

from enum import IntEnum

from robotd.errors import InvalidArgument


class RejectionCode(IntEnum):
    """Error codes of the FollowJointTrajectory result that a rejection can have."""

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
