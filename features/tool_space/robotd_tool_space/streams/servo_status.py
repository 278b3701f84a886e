"""Status of a streamed tool motion, with the codes of MoveIt Servo."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple


class ServoCode(IntEnum):
    """Codes of moveit_msgs/ServoStatus of MoveIt 2.

    Before a collision the tool is stopped: ``DECELERATE_FOR_COLLISION`` does not occur.
    """

    INVALID = -1
    NO_WARNING = 0
    DECELERATE_FOR_APPROACHING_SINGULARITY = 1
    HALT_FOR_SINGULARITY = 2
    DECELERATE_FOR_LEAVING_SINGULARITY = 3
    DECELERATE_FOR_COLLISION = 4
    HALT_FOR_COLLISION = 5
    JOINT_BOUND = 6


class ServoStatus(NamedTuple):
    """State of the stream.

    Attributes:
        code: of MoveIt Servo.
        factor: share of the commanded speed at which the tool moves, 0 to 1.
        text: reason for a factor below 1; "": none.
    """

    code: ServoCode = ServoCode.NO_WARNING
    factor: float = 1.0
    text: str = ""
