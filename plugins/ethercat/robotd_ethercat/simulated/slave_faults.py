"""Injected faults of a simulated slave."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

from robotd_cia402.simulated import DriveFaults

Key = tuple[int, int | None]


@dataclass
class SlaveFaults(DriveFaults):
    """Faults of objects and of a drive's motion; the defaults are a healthy slave.

    Attributes:
        aborts: object → abort code of every access; subindex None means all.
        unanswered: objects of which SDO requests get no response.
        unpadded: an upload by complete access has one byte for subindex 0 instead of two.
    """

    aborts: dict[Key, int] = field(default_factory=dict)
    unanswered: set[Key] = field(default_factory=set)
    unpadded: bool = False

    def heal(self) -> None:
        """End all faults."""
        healthy = SlaveFaults()
        for fault in fields(self):
            setattr(self, fault.name, getattr(healthy, fault.name))

    def abort_code(self, index: int, sub: int) -> int | None:
        """Return the abort code of an access; None: it is not aborted."""
        return self.aborts.get((index, sub), self.aborts.get((index, None)))

    def ignores(self, index: int, sub: int) -> bool:
        """Return True if a request for the object gets no response."""
        return (index, sub) in self.unanswered or (index, None) in self.unanswered
