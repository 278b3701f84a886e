"""CiA 402 state machine of a drive: commands, transitions, statusword."""

from __future__ import annotations

from enum import Enum, auto

_FAULT_RESET = 0x80
_TRANSITION_BITS = 0x0F


class State(Enum):
    """State of a drive; the value is its statusword pattern (CiA 402-2, table 30)."""

    SWITCH_ON_DISABLED = 0x40
    READY_TO_SWITCH_ON = 0x31
    SWITCHED_ON = 0x33
    OPERATION_ENABLED = 0x37
    QUICK_STOP_ACTIVE = 0x17
    FAULT_REACTION_ACTIVE = 0x1F
    FAULT = 0x08


class Command(Enum):
    """Command in a controlword (CiA 402-2, table 27)."""

    DISABLE_VOLTAGE = auto()
    QUICK_STOP = auto()
    SHUTDOWN = auto()
    SWITCH_ON = auto()
    ENABLE_OPERATION = auto()


TRANSITIONS: dict[tuple[State, Command], State] = {
    (State.SWITCH_ON_DISABLED, Command.SHUTDOWN): State.READY_TO_SWITCH_ON,
    (State.READY_TO_SWITCH_ON, Command.SWITCH_ON): State.SWITCHED_ON,
    (State.READY_TO_SWITCH_ON, Command.ENABLE_OPERATION): State.OPERATION_ENABLED,
    (State.READY_TO_SWITCH_ON, Command.QUICK_STOP): State.SWITCH_ON_DISABLED,
    (State.READY_TO_SWITCH_ON, Command.DISABLE_VOLTAGE): State.SWITCH_ON_DISABLED,
    (State.SWITCHED_ON, Command.ENABLE_OPERATION): State.OPERATION_ENABLED,
    (State.SWITCHED_ON, Command.SHUTDOWN): State.READY_TO_SWITCH_ON,
    (State.SWITCHED_ON, Command.QUICK_STOP): State.SWITCH_ON_DISABLED,
    (State.SWITCHED_ON, Command.DISABLE_VOLTAGE): State.SWITCH_ON_DISABLED,
    (State.OPERATION_ENABLED, Command.SWITCH_ON): State.SWITCHED_ON,
    (State.OPERATION_ENABLED, Command.SHUTDOWN): State.READY_TO_SWITCH_ON,
    (State.OPERATION_ENABLED, Command.DISABLE_VOLTAGE): State.SWITCH_ON_DISABLED,
    (State.OPERATION_ENABLED, Command.QUICK_STOP): State.QUICK_STOP_ACTIVE,
    (State.QUICK_STOP_ACTIVE, Command.ENABLE_OPERATION): State.OPERATION_ENABLED,
    (State.QUICK_STOP_ACTIVE, Command.DISABLE_VOLTAGE): State.SWITCH_ON_DISABLED,
}


def command(controlword: int) -> Command:
    """Return the command in bits 0 to 3."""
    bits = controlword & _TRANSITION_BITS
    if not bits & 2:
        return Command.DISABLE_VOLTAGE
    if not bits & 4:
        return Command.QUICK_STOP
    if not bits & 1:
        return Command.SHUTDOWN
    return Command.ENABLE_OPERATION if bits & 8 else Command.SWITCH_ON


def resets_fault(before: int, now: int) -> bool:
    """Return True if bit 7 rises from one controlword to the next."""
    return bool(now & ~before & _FAULT_RESET)
