"""Latest report of one drive axis, decoded."""

from __future__ import annotations

from robotd_cia402.cyclic_objects import CyclicObjects
from robotd_cia402.emcy import error_text
from robotd_cia402.object_numbers import (
    DEMAND,
    ERROR_CODE,
    MODE_DISPLAY,
    POSITION,
    STATUSWORD,
    SWITCHES,
    TORQUE,
    VELOCITY,
)
from robotd_cia402.scaling import Scaling, wrapped
from robotd_cia402.state_machine import FAULTY, POWERED, DriveState, drive_state


class DriveReport:
    """State and values that the drive sent last.

    Updated by the control loop, read by any thread.

    Attributes:
        known: the node is online and every cyclic input has come.
        state: UNKNOWN while the drive is not ``known``.
        powered, in_alarm: the power stage is on, the drive reports a fault.
        statusword: object 0x6041.
        displayed_mode: object 0x6061.
    """

    def __init__(self, drive: CyclicObjects, scaling: Scaling) -> None:
        self.known = False
        self.state = DriveState.UNKNOWN
        self.powered = self.in_alarm = False
        self.statusword = self.displayed_mode = 0
        self._drive, self._scaling = drive, scaling
        self._counts = self._raw = 0  # position without and with the wrap of the encoder

    @property
    def position(self) -> float:
        """Measured position, rad or m; an endless axis runs over 32 bits."""
        return self._counts * self._scaling.position

    @property
    def velocity(self) -> float:
        """Measured velocity, rad/s or m/s."""
        return self._drive.get(VELOCITY) * self._scaling.velocity

    @property
    def torque(self) -> float:
        """Measured torque, N·m; NaN where the rated torque is not known."""
        return self._drive.get(TORQUE) * self._scaling.torque

    @property
    def error_code(self) -> int:
        """Object 0x603F."""
        return self._drive.get(ERROR_CODE)

    @property
    def alarm_text(self) -> str:
        """Cause of an alarm: the emergency in force, else object 0x603F."""
        active = self._drive.emergency
        return active.text if active is not None else f"error code {error_text(self.error_code)}"

    @property
    def switches(self) -> tuple[bool, bool, bool]:
        """Negative limit, positive limit and home switch, by the axis' own direction."""
        inputs = self._drive.get(SWITCHES)
        negative, positive = bool(inputs & 1), bool(inputs & 2)  # as the drive counts
        if self._scaling.polarity < 0:
            negative, positive = positive, negative
        return negative, positive, bool(inputs & 4)

    @property
    def frames(self) -> int:
        """Cyclic frames sent so far."""
        return self._drive.frames

    def demand(self) -> float:
        """Return the drive's own position command; the measured one where it reports none."""
        if DEMAND not in self._drive.inputs:
            return self.position
        ahead = wrapped(self._drive.get(DEMAND) - self._raw)
        return (self._counts + ahead) * self._scaling.position

    def update(self) -> None:
        """Control loop: decode the values taken last."""
        drive = self._drive
        self.displayed_mode = drive.get(MODE_DISPLAY)
        raw = drive.get(POSITION)
        self._counts += wrapped(raw - self._raw)
        self._raw = raw
        word, known = drive.get(STATUSWORD), drive.online and drive.complete
        if word != self.statusword or known is not self.known:
            self.statusword, self.known = word, known
            self.state = state = drive_state(word) if known else DriveState.UNKNOWN
            self.powered, self.in_alarm = state in POWERED, state in FAULTY

    def rebase(self) -> None:
        """Worker: restart the count at a position that the drive has set."""
        self._counts = self._raw = self._drive.get(POSITION)

    def forget(self) -> None:
        """Worker: discard the values; the drive has been configured anew."""
        self._drive.forget()
