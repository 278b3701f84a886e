"""What a drive's own profile commands between two of its reports.

A drive that makes the ramps itself reports its demand rarely and without a velocity. The
profile is the trapezoid of CiA 402 (object 0x6086 = 0) with the ramps that it was given, so it
is computed here too; it starts with the SYNC at which the command takes effect.
"""

from __future__ import annotations

from collections.abc import Sequence

from robotd.api import Profile, Segment, profile_to_position, profile_to_rest, profile_to_velocity


class Estimate:
    """One axis' profile, in rad or m; advanced by the cycle, replaced by workers."""

    def __init__(self) -> None:
        self.position = self.velocity = 0.0
        self._segments: Sequence[Segment] = ()
        self._elapsed_s = 0.0

    def rest(self, position: float) -> None:
        """Stand at ``position``."""
        self._segments, self.position, self.velocity = (), position, 0.0

    def move(self, target: float, profile: Profile, hardest: float) -> None:
        """To ``target``; a drive that is too fast to stop there brakes with ``hardest``."""
        self._begin(profile_to_position(self.position, self.velocity, target, profile, hardest))

    def run(self, velocity: float, acceleration: float, deceleration: float) -> None:
        """To the signed ``velocity``, which is then held."""
        ramps = acceleration, deceleration
        self._begin(profile_to_velocity(self.position, self.velocity, velocity, *ramps))

    def stop(self, deceleration: float) -> None:
        """To rest."""
        self._begin(profile_to_rest(self.position, self.velocity, deceleration))

    def advance(self, period_s: float) -> None:
        """Cycle: one SYNC later."""
        segments = self._segments
        if not segments:
            return
        self._elapsed_s += period_s
        begun = [segment for segment in segments if segment.start_s <= self._elapsed_s]
        self.position, self.velocity = begun[-1].at(self._elapsed_s)

    def _begin(self, segments: Sequence[Segment]) -> None:
        self._elapsed_s = 0.0
        self._segments = segments
