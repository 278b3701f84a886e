"""Injected faults of a simulated drive, whatever its bus."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class DriveFaults:
    """Faults in force for one drive; the defaults are a healthy one.

    Attributes:
        statusword: shown instead of the real one.
        blocked: the motor does not move.
    """

    statusword: int | None = None
    blocked: bool = False
