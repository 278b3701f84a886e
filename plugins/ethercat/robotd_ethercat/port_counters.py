"""Error counters of the ports of a slave controller (ETG.1000.4, registers 0x0300 to 0x0313)."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Protocol

_FIRST = 0x0300
_LAYOUT = struct.Struct(
    "<8B4B2B2x4B"
)  # per port: invalid frame, RX error; forwarded; PU, PDI; lost
REGISTERS = (0x0300, 0x0308, 0x030C, 0x030D, 0x0310)
"""Addresses; a write there clears a group of counters."""


class RegisterAccess(Protocol):
    """Registers of one slave. Worker threads."""

    def read_register(self, address: int, length: int) -> bytes:
        """Raises DeviceTimeout."""


@dataclass(frozen=True)
class PortCounters:
    """Errors at ports 0 to 3 since the counters were cleared; each stops at 255.

    Attributes:
        invalid: frames with a wrong checksum or length, first seen at this port.
        receive: errors of the physical layer.
        forwarded: frames that another slave before this one had marked as invalid.
        lost: losses of the link.
    """

    invalid: tuple[int, ...]
    receive: tuple[int, ...]
    forwarded: tuple[int, ...]
    lost: tuple[int, ...]

    @classmethod
    def read(cls, slave: RegisterAccess) -> PortCounters:
        """Read the registers. Raises DeviceTimeout."""
        values = _LAYOUT.unpack(slave.read_register(_FIRST, _LAYOUT.size))
        return cls(values[0:8:2], values[1:8:2], values[8:12], values[14:18])

    @property
    def text(self) -> str:
        """``port 1: lost links 2, invalid frames 3``; "" while all are 0."""
        ports = []
        for port in range(4):
            named = {
                "lost links": self.lost[port],
                "invalid frames": self.invalid[port],
                "receive errors": self.receive[port],
                "forwarded errors": self.forwarded[port],
            }
            counted = [f"{name} {count}" for name, count in named.items() if count]
            if counted:
                ports.append(f"port {port}: {', '.join(counted)}")
        return "; ".join(ports)

    @property
    def extra(self) -> dict[str, int]:
        """Entries of ``BusNode.extra``, sums over the ports."""
        return {
            "lost_links": sum(self.lost),
            "invalid_frames": sum(self.invalid),
            "receive_errors": sum(self.receive),
            "forwarded_errors": sum(self.forwarded),
        }
