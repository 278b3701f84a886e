"""State machine of a CiA 402 drive: states, statusword, controlword, transitions.

Masks and values are those of CiA 402-2, tables 27 to 30.
"""

from __future__ import annotations

from enum import Enum, IntFlag


class DriveState(Enum):
    """State in a statusword."""

    NOT_READY_TO_SWITCH_ON = "not ready to switch on"
    SWITCH_ON_DISABLED = "switch on disabled"
    READY_TO_SWITCH_ON = "ready to switch on"
    SWITCHED_ON = "switched on"
    OPERATION_ENABLED = "operation enabled"
    QUICK_STOP_ACTIVE = "quick stop active"
    FAULT_REACTION_ACTIVE = "fault reaction active"
    FAULT = "fault"
    UNKNOWN = "unknown"


class Status(IntFlag):
    """Bits of the statusword that do not belong to the state."""

    VOLTAGE_ENABLED = 1 << 4
    WARNING = 1 << 7
    TARGET_REACHED = 1 << 10
    INTERNAL_LIMIT = 1 << 11
    ACKNOWLEDGE = 1 << 12  # profile position: the new set-point is taken
    HOMING_ATTAINED = 1 << 12
    SPEED_ZERO = 1 << 12  # profile velocity
    FOLLOWS = 1 << 12  # cyclic modes: the drive follows the target
    FOLLOWING_ERROR = 1 << 13
    HOMING_ERROR = 1 << 13


class Control(IntFlag):
    """Controlwords of the state machine, and the bits of the modes."""

    DISABLE_VOLTAGE = 0x00
    SHUTDOWN = 0x06
    SWITCH_ON = 0x07
    ENABLE_OPERATION = 0x0F
    QUICK_STOP = 0x02
    FAULT_RESET = 0x80
    NEW_SET_POINT = 1 << 4
    START_HOMING = 1 << 4
    ENABLE_INTERPOLATION = 1 << 4
    CHANGE_IMMEDIATELY = 1 << 5
    HALT = 1 << 8


_STATES = (
    (0x4F, 0x00, DriveState.NOT_READY_TO_SWITCH_ON),
    (0x4F, 0x40, DriveState.SWITCH_ON_DISABLED),
    (0x6F, 0x21, DriveState.READY_TO_SWITCH_ON),
    (0x6F, 0x23, DriveState.SWITCHED_ON),
    (0x6F, 0x27, DriveState.OPERATION_ENABLED),
    (0x6F, 0x07, DriveState.QUICK_STOP_ACTIVE),
    (0x4F, 0x0F, DriveState.FAULT_REACTION_ACTIVE),
    (0x4F, 0x08, DriveState.FAULT),
)


def _decode(word: int) -> DriveState:
    for mask, value, state in _STATES:
        if word & mask == value:
            return state
    return DriveState.UNKNOWN


_DECODED = tuple(_decode(word) for word in range(0x80))

TOWARDS_ENABLED: dict[DriveState, Control] = {
    DriveState.SWITCH_ON_DISABLED: Control.SHUTDOWN,  # transition 2
    DriveState.READY_TO_SWITCH_ON: Control.SWITCH_ON,  # 3
    DriveState.SWITCHED_ON: Control.ENABLE_OPERATION,  # 4
    DriveState.OPERATION_ENABLED: Control.ENABLE_OPERATION,
    DriveState.QUICK_STOP_ACTIVE: Control.ENABLE_OPERATION,  # 16
}
"""State → controlword that leads to OPERATION_ENABLED; other states need no command."""

POWERED = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
FAULTY = (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE)


def drive_state(statusword: int) -> DriveState:
    """Return the state in a statusword."""
    return _DECODED[statusword & 0x7F]
