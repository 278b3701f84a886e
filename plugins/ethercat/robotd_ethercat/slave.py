"""One slave, seen from the master: identity, state, objects, and process data of a drive."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from typing import TypeVar

from robotd.api import Clock, OperationError, RobotdError
from robotd_cia402.drive_access import SdoAbort
from robotd_cia402.node import IDENTITY, Emergency, FieldbusNode
from robotd_cia402.options import parse_object
from robotd_cia402.start_pace import StartPace
from robotd_ethercat.al_status import AlState
from robotd_ethercat.mapping import SlaveImage, object_format
from robotd_ethercat.options import AxisOptions, IoOptions, SlaveOptions
from robotd_ethercat.soem import Soem

RESET = "it was reset and has lost its configuration; start communication again"
"""Cause of the loss of a slave that has restarted by itself."""
_ALIAS_REGISTER = 0x0012  # configured station alias (ETG.1000.4)
T = TypeVar("T")
_SIZES = {"b": 1, "h": 2, "i": 4}


class Slave(FieldbusNode):
    """A drive or I/O module; its number is its place on the cable.

    Attributes:
        options: its sections; several for a multi-axis drive.
        state, al_code: AL state and status code, as read last.
        counter: part of the working counter that it adds while it is operational.
        sizes: bytes of outputs and of inputs; 0 before bring-up.
        image: process data of a drive; empty for an I/O module.
        missed: frames in a row that it has not processed, as far as is known; of a drive.
        pace: of the start that configures it.
        unreached: the last of these returned, so that it was not lost behind the slave.
    """

    def __init__(
        self,
        bus: Soem,
        number: int,
        what: str,
        options: Sequence[SlaveOptions],
        emergencies: deque[Emergency],
        clock: Clock,
    ) -> None:
        super().__init__("slave", number, what, emergencies)
        self.options = options
        self.state, self.al_code = AlState.NONE, 0
        self.alias = self.counter = self.losses = 0
        self.sizes = (0, 0)
        self.image = SlaveImage()
        self.missed, self.unreached = 0, False
        self.pace = StartPace(clock)
        self._bus, self._clock = bus, clock

    @property
    def is_drive(self) -> bool:
        """False for an I/O module."""
        return isinstance(self.options[0], AxisOptions)

    @property
    def module(self) -> IoOptions | None:
        """Options of an I/O module; None for a drive."""
        options = self.options[0]
        return options if isinstance(options, IoOptions) else None

    def identify(self) -> None:
        """Read identity and alias and compare them. Raises OperationError with both values.

        The slave is in Init: errors that it has reported before are not in force any more.
        """
        self.forget_emergency_before(self._clock.now_ns())
        self.identity = self._bus.identity(self.number)
        self.alias = int.from_bytes(
            self._bus.read_register(self.number, _ALIAS_REGISTER, 2), "little"
        )
        self._bus.on_emergency(self.number, self._on_emergency)
        for options in self.options:
            if options.alias not in (None, self.alias):
                raise OperationError(
                    f"alias: the station alias is {self.alias}, expected is {options.alias}"
                )
            for key, actual in zip(IDENTITY, self.identity, strict=True):
                expected = getattr(options.identity, key)
                if expected not in (None, actual):
                    raise OperationError(
                        f"identity: {key} is 0x{actual:08X}, expected is 0x{expected:08X}:"
                        " another device is at this place of the cable"
                    )

    def write_startup(self) -> None:
        """Write the start-up objects of the options. Raises OperationError."""
        for options in self.options:
            for write in options.startup:
                self.write(*parse_object(write.object), write.value, retry=False)

    def upload(self, index: int, sub: int = 0) -> bytes:
        """Read an object, raw. Raises SdoAbort, DeviceTimeout, OperationError."""
        return self._named("reading", index, sub, lambda: self._bus.upload(self.number, index, sub))

    def download(self, index: int, sub: int, data: bytes, *, retry: bool = True) -> None:
        """Write an object, raw. Raises SdoAbort, DeviceTimeout, OperationError.

        ``retry``: see ``Soem.download``.
        """

        def write() -> None:
            self._bus.download(self.number, index, sub, data, retry=retry)

        self._named("writing", index, sub, write)

    def read(self, index: int, sub: int = 0) -> int:
        """Read an integer, signed if its type is known to be."""
        code = object_format(index, sub)
        signed = code is not None and code.islower()
        return int.from_bytes(self.upload(index, sub), "little", signed=signed)

    def write(self, index: int, sub: int, value: int, *, retry: bool = True) -> None:
        """Write an integer of its known size, else of the size that it reads with."""
        code = object_format(index, sub)
        size = _SIZES[code.lower()] if code else len(self.upload(index, sub))
        limit = 1 << 8 * size
        if not -limit // 2 <= value < limit:
            raise OperationError(
                f"{self.name}: object 0x{index:04X}:{sub:02X}: {value} does not fit in {size} bytes"
            )
        self.download(index, sub, (value % limit).to_bytes(size, "little"), retry=retry)

    def has(self, index: int) -> bool:
        """Return True if the slave has the object. Raises DeviceTimeout, OperationError."""
        try:
            self.upload(index, 0)
        except SdoAbort:
            return False
        return True

    def read_register(self, address: int, length: int) -> bytes:
        """Read registers of the slave controller. Raises DeviceTimeout."""
        return self._bus.read_register(self.number, address, length)

    def write_register(self, address: int, data: bytes) -> None:
        """Write registers of the slave controller. Raises DeviceTimeout."""
        self._bus.write_register(self.number, address, data)

    def poll_mailbox(self) -> None:
        """Worker: fetch an emergency that waits in the mailbox."""
        self._bus.poll_mailbox(self.number)

    def _named(self, verb: str, index: int, sub: int, action: Callable[[], T]) -> T:
        where = f"{self.name}: {verb} 0x{index:04X}:{sub:02X}"
        self.pace.note_transfer(where)
        try:
            return action()
        except RobotdError as error:
            error.reason = f"{where}: {error.reason}"
            raise

    def _on_emergency(self, data: bytes) -> None:
        self.note_emergency(data, self._clock.now_ns())
