"""Motion state of a robot with the numbers of WMX R2."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

from robotd.api import Operation, ProcessImage
from robotd.api.robots import Outcome, TrajectoryExecution

FAILED = frozenset({Outcome.FAULT, Outcome.PATH_TOLERANCE, Outcome.GOAL_TOLERANCE})


class R2State(IntEnum):
    """``motion_state`` of RobotStatus."""

    IDLE = 0
    STOPPING_LINE = 2
    STOPPING_JOINTS = 3
    LINE = 6
    JOINTS = 7  # joints move together, or by commands of another node
    ERROR_STOP_LINE = 8
    ERROR_STOP_JOINTS = 9
    ERROR = 10
    PAUSED_LINE = 13
    PAUSED_JOINTS = 14
    E_STOPPING = 17
    E_STOPPED = 18


class R2Error(IntEnum):
    """``motion_error_code`` of RobotStatus."""

    NONE = 0
    SYSTEM_E_STOP = 1  # a stop that was not commanded by the service e_stop
    AMPLIFIER = 8
    SERVO_OFF = 10
    USER_E_STOP = 11
    FOLLOWING = 12
    OFFLINE = 13


class R2Fault(NamedTuple):
    """Reason why a robot does not move.

    Attributes:
        code: of the reason.
        joint: index of the joint that it is about; -1: none.
        text: for people.
    """

    code: R2Error = R2Error.NONE
    joint: int = -1
    text: str = ""


NO_FAULT = R2Fault()


def drive_fault(image: ProcessImage, axes: Sequence[int]) -> R2Fault | None:
    """Return the first fault of the drives of ``axes``."""
    for joint, axis in enumerate(axes):
        if text := image.fault(axis):
            code = R2Error.OFFLINE if image.offline[axis] else R2Error.AMPLIFIER
            return R2Fault(code, joint, text)
    return None


def motion_fault(
    execution: TrajectoryExecution, image: ProcessImage, axes: Sequence[int], names: Sequence[str]
) -> R2Fault | None:
    """Return the fault that has ended a motion; None: it ended without one.

    Args:
        execution: has ended.
        image: a copy of the time of the end.
        axes, names: of the joints.
    """
    if execution.outcome not in FAILED:
        return None
    if fault := drive_fault(image, axes):
        return fault._replace(text=execution.message)
    for joint, axis in enumerate(axes):
        if not image.servo_on[axis]:
            return R2Fault(R2Error.SERVO_OFF, joint, execution.message)
    first_word = execution.message.partition(" ")[0]
    joint = names.index(first_word) if first_word in names else -1
    return R2Fault(R2Error.FOLLOWING, joint, execution.message)


def moving_state(execution: TrajectoryExecution, *, is_line: bool) -> R2State:
    """Return the state of a motion that has not ended."""
    ending = execution.completion.requested
    if ending is None:
        if execution.rate == 0.0:
            return R2State.PAUSED_LINE if is_line else R2State.PAUSED_JOINTS
        return R2State.LINE if is_line else R2State.JOINTS
    if ending[0] in FAILED:
        return R2State.ERROR_STOP_LINE if is_line else R2State.ERROR_STOP_JOINTS
    return R2State.STOPPING_LINE if is_line else R2State.STOPPING_JOINTS


def is_moved(image: ProcessImage, axes: Sequence[int]) -> bool:
    """Return True while something commands one of ``axes``."""
    return any(image.operation[axis] != Operation.IDLE for axis in axes)
