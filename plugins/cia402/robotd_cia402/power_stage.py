"""Controlword of the state machine of one axis."""

from __future__ import annotations

from robotd_cia402.drive_report import DriveReport
from robotd_cia402.state_machine import Control, DriveState


class PowerStage:
    """Commanded state of the power stage. Set by workers; switched off by the control loop.

    Attributes:
        control: bits of the controlword that belong to the state machine.
        requested: the servo is meant to be on.
        lost: why the servo went off by itself; "" if it did not.
    """

    def __init__(self) -> None:
        self.control = int(Control.DISABLE_VOLTAGE)
        self.requested = False
        self.lost = ""

    def command(self, word: Control) -> None:
        """Send ``word`` from the next frame on."""
        self.control = int(word)

    def request(self) -> None:
        """Worker: operation is enabled, and shall stay so."""
        self.requested = True

    def release(self, report: DriveReport) -> None:
        """Worker: switch the power stage off, to ready to switch on.

        From a quick stop only switch on disabled can be reached (transition 12).
        """
        stopped = self.control == Control.QUICK_STOP or report.state is DriveState.QUICK_STOP_ACTIVE
        self.requested = False
        self.command(Control.DISABLE_VOLTAGE if stopped else Control.SHUTDOWN)

    def quick_stop(self) -> None:
        """Any thread: quick stop, unless the power stage is being switched off."""
        if self.requested:
            self.command(Control.QUICK_STOP)

    def reset(self) -> None:
        """Worker: off, with nothing remembered."""
        self.requested, self.lost = False, ""
        self.command(Control.DISABLE_VOLTAGE)

    def watch(self, report: DriveReport) -> bool:
        """Control loop: do not switch on again a drive that switched itself off.

        Returns True at the moment at which it did.
        """
        if not self.requested or report.powered:
            return False
        self.requested = False
        self.command(Control.DISABLE_VOLTAGE)
        self.lost = f"statusword 0x{report.statusword:04X} ({report.state.value})"
        return True
