"""Drive of one axis: its objects, cyclic and by SDO, and its report."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Collection, Sequence

from robotd.api import OperationError, RobotdError
from robotd_cia402.code_tables import error_text, register_text
from robotd_cia402.controlword import FAULTY, POWERED, DriveState, drive_state
from robotd_cia402.node import FieldbusNode
from robotd_cia402.object_numbers import DEMAND, MODE, MODE_DISPLAY, TORQUE, VELOCITY
from robotd_cia402.scaling import Scaling, wrapped

_TRACE_FRAMES = 8  # with a position, over which a velocity is computed
_MISSING = (0x06020000, 0x06090011)  # abort codes: no such object, no such subindex


class SdoAbort(OperationError):
    """SDO transfer aborted by the node; ``code`` is the code of CiA 301."""

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code


class DriveAccess(ABC):
    """Objects of one axis of a node; implemented by each backend.

    ``index`` is the number of an object in the profile, such as 0x6041, without the offset of a
    multi-axis drive. Values are integers in the drive's units, signed if the object's type is.
    The time of received values is not part of it: the backend dates the whole process image.

    Attributes:
        node: on the bus.
        inputs, outputs: objects in the cyclic frames, once it is configured.
        latency: cyclic frames that are sent until the answer to the first of them is taken.
        settling: frames that it answers after a longer silence before it gets a setpoint again.
        turn: frames from one to the next that hold the input which comes most rarely.
        velocity_turn: the same for the velocity.
        unreacting: why it need not switch off when its connection is lost; "" if it does.
        shown_mode: the mode display that was read by SDO last; 0: not known.
    """

    node: FieldbusNode
    inputs: Collection[int]
    outputs: Collection[int]
    latency = 1
    settling = 0
    turn = velocity_turn = 1

    def __init__(self) -> None:
        self._written: dict[tuple[int, int], int] = {}
        self._missing: set[int] = set()
        self._reported: set[int] = set()
        self.unreacting = ""
        self.shown_mode = 0

    @property
    @abstractmethod
    def known(self) -> bool:
        """True for an online node whose cyclic inputs have all come since it was configured.

        Control loop.
        """

    @property
    @abstractmethod
    def awaited(self) -> str:
        """Cyclic inputs that a node which is online but not ``known`` has not sent yet.

        Control loop.
        """

    @property
    @abstractmethod
    def frames(self) -> int:
        """Cyclic frames sent so far; a value may be one frame old. Any thread."""

    @property
    @abstractmethod
    def answered(self) -> int:
        """Number of the cyclic frame that the position taken last answers. Control loop."""

    @property
    @abstractmethod
    def missed(self) -> int:
        """Cyclic frames in a row whose answers should be there by now, and are not. Control loop.

        0 for a drive whose answers belong to no frame.
        """

    @property
    def maps_mode(self) -> bool:
        """The cyclic frames hold the mode and its display. Worker."""
        return MODE in self.outputs and MODE_DISPLAY in self.inputs

    @property
    def unreached(self) -> bool:
        """True where the ``missed`` frames certainly did not reach the drive. Control loop."""
        return False

    @property
    def blocked(self) -> bool:
        """Cyclic frames wait in this computer: none is sent now. Control loop."""
        return False

    @abstractmethod
    def put(self, values: Sequence[int]) -> None:
        """Send the outputs, or set them for the next cyclic frame. Control loop.

        Args:
            values: of the objects in ``OUTPUTS``; those that the frames do not hold are ignored.
        """

    @abstractmethod
    def values(self) -> Sequence[int]:
        """Return the inputs taken last, in the order of ``INPUTS``. Control loop.

        0 before an object has come, and for one that the frames do not hold.
        """

    @abstractmethod
    def writable(self, index: int, sub: int) -> bool:
        """Return False for an object that is missing or read-only. Worker."""

    @abstractmethod
    def read(self, index: int, sub: int = 0) -> int:
        """Read an object by SDO. Worker. Raises SdoAbort, DeviceTimeout, OperationError."""

    @abstractmethod
    def write(self, index: int, sub: int, value: int) -> None:
        """Write an object by SDO. Worker. Raises SdoAbort, DeviceTimeout, OperationError."""

    @abstractmethod
    def forget(self) -> None:
        """Discard the inputs: the drive has been configured anew. Worker."""

    def note_mode(self, shown: int) -> None:
        """Take the mode display that was read by SDO; 0: not known. Worker.

        Where no cyclic frame holds it, it is part of ``values`` from now on.
        """
        self.shown_mode = shown

    def require_unique(self, timeout_s: float) -> None:  # noqa: B027 - not on every bus
        """Raise OperationError where another node answers as this one. Worker.

        Positions of both would be mixed. Raises DeviceTimeout: not known after ``timeout_s``.
        """

    def set_value(self, index: int, sub: int, value: int) -> None:
        """Write an object unless it has that value. Worker. Raises the errors of ``write``."""
        if self._written.get((index, sub)) != value:
            self._written.pop((index, sub), None)  # without an answer it may have been executed
            self.write(index, sub, value)
            self._written[index, sub] = value

    def set_optional(self, index: int, value: int) -> bool:
        """Set an object; False: the drive has none. Raises the errors of ``write``."""
        if index in self._missing:
            return False
        try:
            if (index, 0) in self._written or self.writable(index, 0):
                self.set_value(index, 0, value)
                return True
        except SdoAbort as error:
            if error.code not in _MISSING:
                raise
        self._missing.add(index)
        return False

    def is_news(self, index: int) -> bool:
        """Return True the first time that an object is reported as missing."""
        news = index not in self._reported
        self._reported.add(index)
        return news

    def forget_written(self) -> None:
        """Write everything again when it is needed next: reset drive, or another scale."""
        self._written.clear()


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
        velocity: measured, rad/s or m/s; computed from positions where no frame holds 0x606C.
        torque: measured, N·m; NaN where it or the rated torque is not known.
        digital_inputs: object 0x60FD.
        period_s: between two cyclic frames; 0 before the drive is set up.
    """

    def __init__(self, drive: DriveAccess, scaling: Scaling) -> None:
        self.known = False
        self.state = DriveState.UNKNOWN
        self.powered = self.in_alarm = False
        self.statusword = self.displayed_mode = self.error_code = self.digital_inputs = 0
        self.error_register = 0
        self.position = self.velocity = self.torque = 0.0
        self._drive, self._scaling = drive, scaling
        self._counts = self._raw = 0  # position without and with the wrap of the encoder
        self._demand = 0
        self.period_s = 0.0
        self._trace: deque[tuple[int, int]] = deque(maxlen=_TRACE_FRAMES + 1)  # frames, counts

    @property
    def alarm_text(self) -> str:
        """Cause of an alarm: the emergency in force, else object 0x603F, else what is known.

        An emergency that has the class of the remaining errors alone comes after 0x603F.
        """
        active = self._drive.node.emergency
        if active is not None and not (active.leaves_errors and self.error_code):
            return active.text
        if self.error_code:
            return f"error code {error_text(self.error_code)}"
        register = self.error_register
        named = f", error register {register_text(register)}" if register else ""
        return f"no error code, statusword 0x{self.statusword:04X} ({self.state.value}){named}"

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
        known = drive.known
        if VELOCITY in drive.inputs:
            self.velocity = velocity * scaling.velocity
        elif known:
            self.velocity = self._computed_velocity()
        else:
            self._trace.clear()
            self.velocity = 0.0
        self.torque = torque * scaling.torque if TORQUE in drive.inputs else math.nan
        if word != self.statusword or known is not self.known:
            self.statusword, self.known = word, known
            self.state = state = drive_state(word) if known else DriveState.UNKNOWN
            self.powered, self.in_alarm = state in POWERED, state in FAULTY
            if known and not self.in_alarm:
                self.error_register = 0

    def _computed_velocity(self) -> float:
        """Return the velocity over the latest positions.

        Without it every stop would seem to be at rest at once.
        """
        trace, frame = self._trace, self._drive.answered
        if trace and frame == trace[-1][0]:
            return self.velocity  # no new position: the axis need not rest
        trace.append((frame, self._counts))
        span_s = (frame - trace[0][0]) * self.period_s
        moved = self._counts - trace[0][1]
        return moved * self._scaling.position / span_s if span_s else self.velocity

    def read_error_register(self) -> None:
        """Worker: read object 0x1001, where the drive answers."""
        try:
            self.error_register = self._drive.read(0x1001) & 0xFF
        except RobotdError:
            self.error_register = 0

    def rebase(self) -> None:
        """Worker: restart the count at a position that the drive has set."""
        self._trace.clear()
        self._counts = self._raw
        self.position = self._counts * self._scaling.position

    def switches(self) -> tuple[bool, bool, bool]:
        """Return negative limit, positive limit and home switch, by the axis' own direction."""
        inputs = self.digital_inputs
        negative, positive = bool(inputs & 1), bool(inputs & 2)  # as the drive counts
        if self._scaling.polarity < 0:
            negative, positive = positive, negative
        return negative, positive, bool(inputs & 4)
