"""Why a trajectory is refused before anything moves."""

from __future__ import annotations

from enum import IntEnum

from robotd.errors import InvalidArgument


class RefusalCode(IntEnum):
    """The error codes of the FollowJointTrajectory result that a refusal can have."""

    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3


class TrajectoryRefused(InvalidArgument):
    """The trajectory is not executed. The text names the joint, the time, the value, the limit."""

    code: RefusalCode

    def __init__(self, code: RefusalCode, message: str) -> None:
        self.code = code
        super().__init__(message)


def refuse(message: str) -> TrajectoryRefused:
    """An ``INVALID_GOAL`` refusal, ready to be raised."""
    return TrajectoryRefused(RefusalCode.INVALID_GOAL, message)


def refuse_joints(message: str) -> TrajectoryRefused:
    """An ``INVALID_JOINTS`` refusal, ready to be raised."""
    return TrajectoryRefused(RefusalCode.INVALID_JOINTS, message)
