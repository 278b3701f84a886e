"""Why a trajectory is refused before anything moves."""

from __future__ import annotations

from enum import IntEnum

from robotd.errors import InvalidArgument


class RejectionCode(IntEnum):
    """The error codes of the FollowJointTrajectory result that a rejection can have."""

    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3


class TrajectoryRejected(InvalidArgument):
    """The trajectory is not executed. The text names the joint, the time, the value, the limit."""

    code: RejectionCode

    def __init__(self, code: RejectionCode, message: str) -> None:
        super().__init__(message, code=code)


def reject(message: str) -> TrajectoryRejected:
    """An ``INVALID_GOAL`` rejection, ready to be raised."""
    return TrajectoryRejected(RejectionCode.INVALID_GOAL, message)


def reject_joints(message: str) -> TrajectoryRejected:
    """An ``INVALID_JOINTS`` rejection, ready to be raised."""
    return TrajectoryRejected(RejectionCode.INVALID_JOINTS, message)
