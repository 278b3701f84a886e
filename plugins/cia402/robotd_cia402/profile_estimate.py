"""Estimated command of a profile that the drive runs by itself.

A drive that makes the ramps itself reports its demand rarely and without a velocity. The
profile is the trapezoid of CiA 402 (object 0x6086 = 0) with the ramps that it was given, so it
is computed here too; it starts with the frame with which the command takes effect.
"""

from __future__ import annotations

from collections.abc import Sequence

from robotd.api import Profile, Segment, profile_to_position, profile_to_rest, profile_to_velocity


class ProfileEstimate:
    """Profile of one axis (rad or m); advanced by the control loop, set by workers.

    Args:
        max_deceleration: with which a drive brakes that is too fast to stop at its target.

    Attributes:
        position, velocity: command at the frame that was sent last.
    """

    def __init__(self, max_deceleration: float) -> None:
        self.position = self.velocity = 0.0
        self._segments: Sequence[Segment] = ()
        self._elapsed_s = 0.0
        self._max_deceleration = max_deceleration
        self._planned: tuple[float, Profile] | None = None

    def rest(self, position: float) -> None:
        """Stand at ``position``."""
        self._segments, self.position, self.velocity = (), position, 0.0

    def plan(self, target: float, profile: Profile) -> None:
        """Worker: a move to ``target`` that begins when it is handed over to the drive."""
        self._planned = target, profile

    def begin_planned(self) -> None:
        """Control loop: begin the planned move, with the frame that hands it over."""
        if self._planned is not None:
            state = self.position, self.velocity
            self._begin(profile_to_position(*state, *self._planned, self._max_deceleration))

    def run(self, velocity: float, acceleration: float, deceleration: float) -> None:
        """Change to the signed ``velocity``, which is then held."""
        ramps = acceleration, deceleration
        self._begin(profile_to_velocity(self.position, self.velocity, velocity, *ramps))

    def stop(self, deceleration: float) -> None:
        """Change to rest."""
        self._begin(profile_to_rest(self.position, self.velocity, deceleration))

    def advance(self, period_s: float) -> None:
        """Control loop: advance by the time between two frames."""
        segments = self._segments
        if not segments:
            return
        self._elapsed_s += period_s
        begun = [segment for segment in segments if segment.start_s <= self._elapsed_s]
        self.position, self.velocity = begun[-1].at(self._elapsed_s)

    def _begin(self, segments: Sequence[Segment]) -> None:
        self._elapsed_s = 0.0
        self._segments = segments
