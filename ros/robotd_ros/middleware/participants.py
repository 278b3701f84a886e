"""Process and host of nodes that have one name, read from the GUIDs of Fast DDS.

Works around: ROS shows the GUIDs of endpoints but not whose they are. Fast DDS builds the first
twelve bytes from its vendor number, a hash of the host, the lower half of the process number and a
random number (``GuidUtils::guid_prefix_create``). Other middlewares do otherwise: there nothing is
known.
Measured: nothing; read only while two processes have nodes of one name.
Upstream: none known; the graph of ROS has no processes by design.
Ends with: no version, it is by design.
Shown by: tests/ros/test_side_by_side.py.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Self

_VENDOR = b"\x01\x0f"  # eProsima; RTPS 2.5, annex of vendor numbers
_MAX_COMMAND = 120  # characters


@dataclass(frozen=True)
class Participant:
    """A process in the DDS domain.

    Attributes:
        host: hash of the computer's (or container's) network addresses.
        process: the process number modulo 65536.
    """

    host: int
    process: int

    @classmethod
    def of(cls, gid: bytes) -> Self | None:
        """Owner of the endpoint with this GUID; None when another middleware made it."""
        if gid[:2] != _VENDOR:
            return None
        return cls(int.from_bytes(gid[2:4], "little"), int.from_bytes(gid[4:6], "little"))

    @property
    def is_own(self) -> bool:
        """True where this may be the calling process; another host can have its number."""
        return self.process == os.getpid() % 0x10000

    def describe(self, own_host: int | None) -> str:
        """Process number and command line on this host; of another host its hash."""
        if self.host != own_host:
            return (
                f"a process with number {self.process} (modulo 65536) on another host or container"
            )
        found = [f"process {number}: {command}" for number, command in self._commands()]
        return " or ".join(found) or f"process {self.process} of this host, which has ended"

    def _commands(self) -> list[tuple[int, str]]:
        numbers = [int(path.name) for path in Path("/proc").iterdir() if path.name.isdigit()]
        found = []
        for number in numbers:
            if number % 0x10000 != self.process:
                continue
            try:
                words = Path(f"/proc/{number}/cmdline").read_bytes().rstrip(b"\0").split(b"\0")
            except OSError:
                continue  # it has ended
            found.append((number, b" ".join(words).decode(errors="replace")[:_MAX_COMMAND]))
        return found
