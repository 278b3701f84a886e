"""Controlword of one axis: state machine, mode of operation, and hand-over of targets.

Masks and values are those of CiA 402-2, tables 27 to 30. The controlword has bits of the state
machine (``PowerStage``) and bits whose meaning depends on the mode (``ModeControl``).
"""

from __future__ import annotations

import threading
from enum import Enum, IntFlag, auto

from robotd.api import CommandMode
from robotd_cia402.modes import OperationMode, mode_text

_LOW_FRAMES = 2  # frames in the mode, with the target and the bit low, before it may rise
_HANDSHAKE_TIMEOUT_S = 1.0
_MODE_LOST_S = 0.1  # in another mode, after which that is no remnant of an earlier request


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


class StatusBits(IntFlag):
    """Bits of the statusword that do not belong to the state."""

    TARGET_REACHED = 1 << 10
    INTERNAL_LIMIT = 1 << 11
    ACKNOWLEDGE = 1 << 12  # profile position: the new set-point is taken
    HOMING_ATTAINED = 1 << 12
    FOLLOWS = 1 << 12  # cyclic synchronous modes: setpoints are followed, not ignored
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

_POWERLESS = (Control.DISABLE_VOLTAGE, Control.SHUTDOWN)
POWERED = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
FAULTY = (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE)


def drive_state(statusword: int) -> DriveState:
    """Return the state in a statusword."""
    return _DECODED[statusword & 0x7F]


class PowerStage:
    """Commanded state of the power stage. Set by workers; switched off by the control loop.

    Attributes:
        control: bits of the controlword that belong to the state machine.
        requested: the servo is meant to be on.
        lost: why the servo went off by itself; "" if it did not.
        releases: number of times that it was switched off.
        may_be_on: it was switched on, and the drive has not confirmed since that it is off.
    """

    def __init__(self) -> None:
        self.releases = 0
        self.may_be_on = False
        self._lock = threading.Lock()  # a switch-off is final: what comes with it has no effect
        self.reset()

    def reset(self) -> None:
        """Worker: off, with nothing remembered."""
        with self._lock:
            self.requested, self.lost = False, ""
            self.control = Control.DISABLE_VOLTAGE.value
            self.releases += 1

    def switch_on(self, control: Control, releases: int, *, done: bool = False) -> bool:
        """Worker: one step of switching on; False, with no effect, after a switch-off.

        Args:
            releases: when switching on began.
            done: operation is enabled, so the servo is meant to be on.
        """
        with self._lock:
            if self.releases == releases:
                self.control, self.requested = control.value, done
                self.may_be_on |= control not in _POWERLESS
            return self.releases == releases

    def release(self, state: DriveState) -> None:
        """Any thread: switch the power stage off, to ready to switch on.

        From a quick stop only switch on disabled can be reached (transition 12). One that is being
        switched off by that goes on.
        """
        words = Control.QUICK_STOP, Control.DISABLE_VOLTAGE
        with self._lock:
            stopped = self.control in words or state is DriveState.QUICK_STOP_ACTIVE
            self.requested = False
            self.control = (Control.DISABLE_VOLTAGE if stopped else Control.SHUTDOWN).value
            self.releases += 1

    def quick_stop(self) -> None:
        """Any thread: quick stop, unless the power stage is being switched off."""
        self._command(Control.QUICK_STOP)

    def leave_quick_stop(self) -> None:
        """Worker: operation enabled again, unless the power stage is being switched off."""
        self._command(Control.ENABLE_OPERATION)

    def _command(self, control: Control) -> None:
        with self._lock:
            if self.requested:
                self.control = control.value

    def note_off(self, statusword: int, state: DriveState) -> bool:
        """Control loop: do not switch on again a drive that switched itself off.

        Returns True at the moment at which it did.
        """
        with self._lock:
            if not self.requested:
                return False
            self.requested = self.may_be_on = False
            self.control = Control.DISABLE_VOLTAGE.value
        self.lost = f"statusword 0x{statusword:04X} ({state.value})"
        return True


class Phase(Enum):
    """Phase of the new-set-point handshake of the profile position mode (CiA 402-2, 10.3)."""

    DONE = auto()  # nothing is under way; the target is in force
    ENTERING = auto()  # until the drive is in the mode and the bit was low
    ASKING = auto()  # the bit is high, until the drive acknowledges
    RELEASING = auto()  # the bit is low again, until the acknowledge goes
    FAILED = auto()  # the drive did not answer in time


class ModeControl:
    """Requested mode of operation. Set by workers; the control loop runs the handshake.

    Attributes:
        requested: mode of operation (object 0x6060).
        command_mode: as the user has set it.
        bits: bits of the controlword whose meaning depends on the mode.
        phase: of the handshake.
        lost: why the drive is not in the requested mode, which it has left by itself; "" if it is.
    """

    def __init__(self, requested: OperationMode) -> None:
        self.requested = requested
        self.lost = ""
        self._entered: OperationMode | None = None  # displayed since it has been requested
        self._elsewhere_s = 0.0  # in another mode
        self.command_mode = CommandMode.POSITION
        self.bits = self._frames = self._low_frames = 0
        self.phase = Phase.DONE
        self._lock = threading.Lock()  # between a stop and the handshake that it ends

    def watch(self, displayed_mode: int, period_s: float) -> bool:
        """Control loop: one frame of an enabled drive; True once when it has left its mode.

        Homing does not count: drives may leave it at its end.
        """
        requested = self.requested
        if displayed_mode == requested:
            self._entered, self._elsewhere_s, self.lost = requested, 0.0, ""
            return False
        if self._entered is not requested or requested is OperationMode.HOMING:
            self._entered, self._elsewhere_s = None, 0.0
            return False
        self._elsewhere_s += period_s
        if self.lost or self._elsewhere_s < _MODE_LOST_S:
            return False
        found, wanted = mode_text(displayed_mode), mode_text(requested)
        self.lost = f"the drive has changed to {found} by itself, {wanted} is commanded"
        return True

    def forget(self) -> None:
        """Forget the mode that the drive was in: it is off, or not known."""
        self._entered, self._elsewhere_s, self.lost = None, 0.0, ""

    def begin_target(self) -> None:
        """Worker: hand a new target over; the control loop does it, frame by frame.

        An axis that is halted remains so until the target is acknowledged.
        """
        with self._lock:
            in_mode = self.requested is OperationMode.PROFILE_POSITION
            halted = self.bits & Control.HALT if in_mode else 0
            self.bits = int(Control.CHANGE_IMMEDIATELY | halted)
            self._enter(Phase.ENTERING)
            self.requested = OperationMode.PROFILE_POSITION

    def cancel_target(self) -> None:
        """Any thread: halt a profile position move, whatever its handshake has reached."""
        with self._lock:
            self.bits = int(Control.HALT)
            self._enter(Phase.DONE)

    def advance_target(self, statusword: int, displayed_mode: int, period_s: float) -> bool:
        """Control loop: one frame of the handshake; True if another phase begins with it.

        The target is sent from when on the drive displays the mode. It comes some frames before
        the bit: a drive may read the controlword of a frame first.
        """
        with self._lock:
            return self._advance_target(statusword, displayed_mode, period_s)

    def _advance_target(self, statusword: int, displayed_mode: int, period_s: float) -> bool:
        before = self.phase
        if before in (Phase.DONE, Phase.FAILED):
            return False
        in_mode = displayed_mode == OperationMode.PROFILE_POSITION
        self._frames += 1
        self._low_frames = self._low_frames + 1 if in_mode else 0
        acknowledged = bool(statusword & StatusBits.ACKNOWLEDGE)
        match before:
            case Phase.ENTERING if self._low_frames > _LOW_FRAMES and not acknowledged:
                self.bits |= Control.NEW_SET_POINT
                self._enter(Phase.ASKING)
            case Phase.ASKING if acknowledged:
                self.bits = int(Control.CHANGE_IMMEDIATELY)
                self._enter(Phase.RELEASING)
            case Phase.RELEASING if not acknowledged:
                self._enter(Phase.DONE)
            case _ if self._frames * period_s > _HANDSHAKE_TIMEOUT_S:
                self._enter(Phase.FAILED)
            case _:
                pass
        return self.phase is not before

    def _enter(self, phase: Phase) -> None:
        self.phase = phase
        self._frames = self._low_frames = 0
