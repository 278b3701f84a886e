"""Node of a fieldbus as the master sees it, and its emergency messages."""

from __future__ import annotations

import struct
from collections import deque
from dataclasses import dataclass

from robotd_cia402.code_tables import error_text, register_text

IDENTITY = ("vendor_id", "product_code", "revision", "serial")
"""Parts of object 0x1018, and keys of ``Identity``."""
HISTORY = 200  # emergencies of all nodes that are kept

_FORMAT = struct.Struct("<HB5s")


@dataclass(frozen=True)
class Emergency:
    """One message. ``register`` is object 0x1001, ``data`` five bytes of the vendor's."""

    time_ns: int
    node: int
    code: int
    register: int
    data: bytes

    @classmethod
    def decode(cls, node: int, data: bytes | bytearray, time_ns: int) -> Emergency:
        """Raises ValueError unless it has 8 bytes."""
        if len(data) != _FORMAT.size:
            raise ValueError(f"an EMCY has 8 bytes, this one {len(data)}")
        code, register, vendor = _FORMAT.unpack(data)
        return cls(time_ns, node, code, register, vendor)

    @property
    def is_reset(self) -> bool:
        """True for an error reset: an error is gone, and all where ``register`` is 0."""
        return self.code >> 8 == 0

    @property
    def text(self) -> str:
        """``EMCY 0x3210 DC link over-voltage``."""
        detail = f", vendor data {self.data.hex(' ')}" if any(self.data) else ""
        if self.leaves_errors:
            left = f"error register {register_text(self.register)}"
            return f"EMCY 0x{self.code:04X} one error is gone, remaining {left}{detail}"
        return f"EMCY {error_text(self.code)}{detail}"

    @property
    def leaves_errors(self) -> bool:
        """True for an error reset with the register of other errors, whose codes it has not."""
        return self.is_reset and self.register != 0

    def __str__(self) -> str:
        return f"node {self.node}: {self.text}"


class FieldbusNode:
    """A drive or an I/O module.

    Attributes:
        number: node id, or place on the cable.
        label: begins the error texts of an axis, to which the core adds its name; ``node 2``.
        name: for all other messages, ``joint2 (node 2)``.
        online: brought up, and not lost since.
        fault: why it is not online, without its name; "" while online and before bring-up.
        identity: as ``IDENTITY``; empty before it is read.
        emergency: in force; None without one.
        unwatched: why it does not notice the loss of robotd; "" if it does.
    """

    def __init__(self, kind: str, number: int, what: str, history: deque[Emergency]) -> None:
        self.number, self.label = number, f"{kind} {number}"
        self.name = f"{what} ({self.label})"
        self.online = False
        self.fault = ""
        self.identity: tuple[int, ...] = ()
        self.emergency: Emergency | None = None
        self.unwatched = ""
        self._history = history

    @property
    def complaint(self) -> str:
        """Error text for a command that needs the node online."""
        return f"{self.name}: {self.fault or 'offline'}"

    def emergency_text(self) -> str:
        """Return the emergency in force, with a leading comma; "" without one."""
        active = self.emergency
        return f", {active.text}" if active is not None else ""

    def note_emergency(self, data: bytes | bytearray, now_ns: int) -> None:
        """Receive thread: take a message of 8 bytes. Raises ValueError otherwise.

        By CiA 301 (7.2.7.1) an error reset with the register of remaining errors leaves the node in
        its error state.
        """
        emergency = Emergency.decode(self.number, data, now_ns)
        self._history.append(emergency)
        ends = emergency.is_reset and not emergency.leaves_errors
        self.emergency = None if ends else emergency

    def forget_emergency_before(self, time_ns: int) -> None:
        """Worker: end an error that the node reported before it was reset at ``time_ns``."""
        emergency = self.emergency
        if emergency is not None and emergency.time_ns < time_ns:
            self.emergency = None
