"""The new-set-point handshake of the profile position mode (CiA 402-2, 10.3), frame by frame."""

from __future__ import annotations

from enum import Enum, auto

from robotd_cia402.state_machine import Control, Status

_LOW_FRAMES = 2  # frames in the mode, with the target and the bit low, before it may rise
_LIMIT_S = 1.0

_IMMEDIATELY = int(Control.CHANGE_IMMEDIATELY)


class Phase(Enum):
    """Phase of the handshake."""

    DONE = auto()  # nothing is under way
    ENTERING = auto()  # until the drive is in the mode and the bit was low
    ASKING = auto()  # the bit is high, until the drive acknowledges
    RELEASING = auto()  # the bit is low again, until the acknowledge goes
    FAILED = auto()  # the drive did not answer in time


class Handshake:
    """One axis' handshake. ``begin`` and ``cancel`` by workers, ``advance`` by the control loop.

    Attributes:
        phase: present phase; the set-point is in force from DONE on.
        bits: bits of the controlword.
    """

    def __init__(self) -> None:
        self.phase = Phase.DONE
        self.bits = 0
        self._frames = self._low_frames = 0
        self._halted = 0

    def begin(self, *, halted: bool) -> None:
        """Begin with a new target; a halted axis remains halted until it is acknowledged."""
        self._halted = int(Control.HALT) if halted else 0
        self.bits = _IMMEDIATELY | self._halted
        self._enter(Phase.ENTERING)

    def cancel(self) -> None:
        """Discard the handshake in progress; the axis is halted."""
        self.bits = int(Control.HALT)
        self._enter(Phase.DONE)

    def advance(self, status: int, *, in_mode: bool, period_s: float) -> None:
        """Advance by one frame, with the statusword of the drive.

        ``in_mode``: the drive displays profile position mode, from when on the target is sent. It
        comes some frames before the bit: a drive may read the controlword of a frame first.
        """
        if self.phase in (Phase.DONE, Phase.FAILED):
            return
        self._frames += 1
        self._low_frames = self._low_frames + 1 if in_mode else 0
        acknowledged = bool(status & Status.ACKNOWLEDGE)
        match self.phase:
            case Phase.ENTERING if self._low_frames > _LOW_FRAMES and not acknowledged:
                self.bits |= Control.NEW_SET_POINT
                self._enter(Phase.ASKING)
            case Phase.ASKING if acknowledged:
                self.bits = _IMMEDIATELY
                self._enter(Phase.RELEASING)
            case Phase.RELEASING if not acknowledged:
                self._enter(Phase.DONE)
            case _ if self._frames * period_s > _LIMIT_S:
                self.bits = _IMMEDIATELY | int(Control.HALT)
                self._enter(Phase.FAILED)
            case _:
                pass

    def _enter(self, phase: Phase) -> None:
        self.phase = phase
        self._frames = self._low_frames = 0
