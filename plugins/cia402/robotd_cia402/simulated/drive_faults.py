"""Injected faults of a simulated drive, whatever its bus."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

Place = tuple[int, int | None]  # index and subindex of an object; None: all subindices


@dataclass
class DriveFaults:
    """Faults in force for one drive; the defaults are a healthy one.

    Attributes:
        statusword: shown instead of the real one.
        blocked: the motor does not move.
        aborts: object → abort code of every access.
        unanswered: objects of which SDO requests get no response.
    """

    statusword: int | None = None
    blocked: bool = False
    aborts: dict[Place, int] = field(default_factory=dict)
    unanswered: set[Place] = field(default_factory=set)

    def heal(self) -> None:
        """End all faults."""
        healthy = type(self)()
        for fault in fields(self):
            setattr(self, fault.name, getattr(healthy, fault.name))

    def abort_code(self, index: int, sub: int) -> int | None:
        """Return the abort code of an access; None: it is not aborted."""
        return self.aborts.get((index, sub), self.aborts.get((index, None)))

    def ignores(self, index: int, sub: int) -> bool:
        """Return True if a request for the object gets no response."""
        return (index, sub) in self.unanswered or (index, None) in self.unanswered
