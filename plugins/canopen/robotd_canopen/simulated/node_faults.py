"""Injected faults of a simulated node. Used by the thread of the network alone."""

from __future__ import annotations

from dataclasses import dataclass, field
from random import Random

from robotd_cia402.simulated import DriveFaults


@dataclass
class Faults(DriveFaults):
    """Faults in force for one node and its drives; the defaults are a healthy one.

    Attributes:
        silent: sends and receives nothing, as with a broken cable.
        pdo_delay_s: TPDOs are sent this much later; those that wait when it ends are lost.
        pdo_drop: part of the TPDOs that get lost, 0 to 1.
        garbled: part of its frames, PDOs and SDO responses included, replaced by garbage, 0 to 1.
        garbled_frames: frames replaced by garbage so far.
    """

    silent: bool = False
    pdo_delay_s: float = 0.0
    pdo_drop: float = 0.0
    garbled: float = 0.0
    garbled_frames: int = 0
    random: Random = field(default_factory=lambda: Random(1))  # noqa: S311 - repeatable, no secret

    def drops_pdo(self) -> bool:
        """Return True if the TPDO to be sent now is lost."""
        return self.pdo_drop > 0 and self.random.random() < self.pdo_drop

    def garble(self, data: bytes) -> bytes:
        """Return ``data``, or garbage in its place."""
        if self.garbled > 0 and self.random.random() < self.garbled:
            self.garbled_frames += 1
            return self.random.randbytes(self.random.randint(0, 8))
        return data
