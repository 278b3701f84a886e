"""Mode of operation of one axis, with the controlword bits that belong to it."""

from __future__ import annotations

from robotd.api import CommandMode
from robotd_cia402.drive_report import DriveReport
from robotd_cia402.modes import OperationMode
from robotd_cia402.set_point_handshake import Handshake, Phase
from robotd_cia402.state_machine import Control


class ModeControl:
    """Requested mode of operation. Set by workers; the control loop runs the handshake.

    Attributes:
        requested: mode of operation (object 0x6060).
        command_mode: as the user has set it.
        bits: bits of the controlword whose meaning depends on the mode.
    """

    def __init__(self, requested: OperationMode) -> None:
        self.requested = requested
        self.command_mode = CommandMode.POSITION
        self.bits = 0
        self._handshake = Handshake()

    @property
    def target_taken(self) -> bool:
        """The handshake is complete: the drive has its target."""
        return self._handshake.phase is Phase.DONE

    def clear_bits(self) -> None:
        self.bits = 0

    def halt(self) -> None:
        """Profile position: keep the drive halted."""
        if self.requested is OperationMode.PROFILE_POSITION:
            self.bits |= Control.HALT

    def begin_target(self) -> None:
        """Worker: hand a new target over; the control loop does it, frame by frame."""
        in_mode = self.requested is OperationMode.PROFILE_POSITION
        self._handshake.begin(halted=in_mode and bool(self.bits & Control.HALT))
        self.bits = self._handshake.bits
        self.requested = OperationMode.PROFILE_POSITION

    def cancel_target(self) -> None:
        """Halt a profile position move, whatever its handshake has reached."""
        self._handshake.cancel()
        self.bits = self._handshake.bits

    def advance_target(self, report: DriveReport, period_s: float) -> Phase | None:
        """Control loop: one frame of the handshake; the phase that begins with it, None: none."""
        before = self._handshake.phase
        in_mode = report.displayed_mode == OperationMode.PROFILE_POSITION
        self._handshake.advance(report.statusword, in_mode=in_mode, period_s=period_s)
        self.bits = self._handshake.bits
        phase = self._handshake.phase
        return phase if phase is not before else None
