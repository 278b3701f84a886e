"""Latest report of one drive axis, decoded."""

from __future__ import annotations

import math

from robotd.api import RobotdError
from robotd_cia402.cyclic_objects import CyclicObjects
from robotd_cia402.emcy import error_text, register_text
from robotd_cia402.object_numbers import DEMAND, TORQUE
from robotd_cia402.scaling import Scaling, wrapped
from robotd_cia402.state_machine import FAULTY, POWERED, DriveState, drive_state


class DriveReport:
    """State and values that the drive sent last.

    Updated by the control loop, read by any thread.

    Attributes:
        known: the node is online and every cyclic input has come.
        state: UNKNOWN while the drive is not ``known``.
        powered, in_alarm: the power stage is on, the drive reports a fault.
        statusword, displayed_mode, error_code: objects 0x6041, 0x6061, 0x603F.
        error_register: object 0x1001, read at start and after a failed command; 0: not known.
        position: measured, rad or m; an endless axis runs over 32 bits.
        velocity: measured, rad/s or m/s.
        torque: measured, N·m; NaN where it or the rated torque is not known.
        digital_inputs: object 0x60FD.
    """

    def __init__(self, drive: CyclicObjects, scaling: Scaling) -> None:
        self.known = False
        self.state = DriveState.UNKNOWN
        self.powered = self.in_alarm = False
        self.statusword = self.displayed_mode = self.error_code = self.digital_inputs = 0
        self.error_register = 0
        self.position = self.velocity = self.torque = 0.0
        self._drive, self._scaling = drive, scaling
        self._counts = self._raw = 0  # position without and with the wrap of the encoder
        self._demand = 0

    @property
    def alarm_text(self) -> str:
        """Cause of an alarm: the emergency in force, else object 0x603F, else what is known."""
        active = self._drive.emergency
        if active is not None:
            return active.text
        if self.error_code:
            return f"error code {error_text(self.error_code)}"
        register = self.error_register
        named = f", error register {register_text(register)}" if register else ""
        return f"no error code, statusword 0x{self.statusword:04X} ({self.state.value}){named}"

    @property
    def frames(self) -> int:
        """Cyclic frames sent so far."""
        return self._drive.frames

    def demand(self) -> float:
        """Return the drive's own position command; the measured one where it reports none."""
        if DEMAND not in self._drive.inputs:
            return self.position
        ahead = wrapped(self._demand - self._raw)
        return (self._counts + ahead) * self._scaling.position

    def update(self) -> None:
        """Control loop: decode the values taken last."""
        drive, scaling = self._drive, self._scaling
        word, mode, raw, self._demand, velocity, torque, error, inputs = drive.values()
        self.displayed_mode, self.error_code, self.digital_inputs = mode, error, inputs
        self._counts += wrapped(raw - self._raw)
        self._raw = raw
        self.position = self._counts * scaling.position
        self.velocity = velocity * scaling.velocity
        self.torque = torque * scaling.torque if TORQUE in drive.inputs else math.nan
        known = drive.known
        if word != self.statusword or known is not self.known:
            self.statusword, self.known = word, known
            self.state = state = drive_state(word) if known else DriveState.UNKNOWN
            self.powered, self.in_alarm = state in POWERED, state in FAULTY
            if known and not self.in_alarm:
                self.error_register = 0

    def read_error_register(self) -> None:
        """Worker: read object 0x1001, where the drive answers."""
        try:
            self.error_register = self._drive.read(0x1001) & 0xFF
        except RobotdError:
            self.error_register = 0

    def rebase(self) -> None:
        """Worker: restart the count at a position that the drive has set."""
        self._counts = self._raw
        self.position = self._counts * self._scaling.position

    def forget(self) -> None:
        """Worker: discard the values; the drive has been configured anew."""
        self._drive.forget()


def switches(digital_inputs: int, polarity: int) -> tuple[bool, bool, bool]:
    """Return negative limit, positive limit and home switch, by the axis' own direction."""
    negative, positive = bool(digital_inputs & 1), bool(digital_inputs & 2)  # as the drive counts
    if polarity < 0:
        negative, positive = positive, negative
    return negative, positive, bool(digital_inputs & 4)
