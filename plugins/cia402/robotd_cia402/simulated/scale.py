"""Counts, units and switches of a simulated drive."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Scale:
    """Drive units per rad, rad/s and rad/s² (or m), and polarity, 1 or -1."""

    position: float
    velocity: float
    acceleration: float
    polarity: int = 1


@dataclass(frozen=True)
class Switches:
    """Positions of the switches, rad (or m) in drive direction; None: no such switch."""

    negative_limit: float | None = None
    positive_limit: float | None = None
    home: float | None = None
    home_width: float = 0.02

    def inputs(self, position: float) -> int:
        """Object 0x60FD at ``position``: bit 0 negative limit, 1 positive limit, 2 home."""
        low, high, home = self.negative_limit, self.positive_limit, self.home
        bits = 1 if low is not None and position <= low else 0
        bits |= 2 if high is not None and position >= high else 0
        return bits | (4 if home is not None and abs(position - home) < self.home_width / 2 else 0)


NO_SWITCHES = Switches()
