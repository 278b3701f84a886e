"""Braking of moves and velocity commands before position limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from robotd.device.process_image import ProcessImage
from robotd.motion.limits import AxisLimits, room_to_stop
from robotd.motion.profile import Profile

REACTION_PERIODS = 3.0  # values are a period old, a stop begins a period later; one to spare


class Braking:
    """Decelerations by which the axes end their commands, and whether these are hard enough.

    Args:
        limits, image: of the axes.
        period_s: control period, s.
        feedback_period_s: see ``AxisDriver``.

    Attributes:
        deceleration: of the last command of each axis, rad/s² or m/s²; inf: none yet.
    """

    def __init__(
        self,
        limits: Sequence[AxisLimits],
        image: ProcessImage,
        period_s: float,
        feedback_period_s: float,
    ) -> None:
        self._limits, self._image = limits, image
        self._reaction_s = REACTION_PERIODS * period_s + feedback_period_s
        self.deceleration = [math.inf] * len(limits)

    def begin(self, axis: int, profile: Profile) -> Profile:
        """Return the profile of a command that begins now, and note its deceleration. Worker.

        The axis may move, and brakes by the new deceleration: it keeps the one in force where
        the new one is too gentle to stop within the limits.
        """
        in_force = self.deceleration[axis]
        too_gentle = profile.deceleration < in_force < math.inf
        if too_gentle and not self._can_stop(axis, profile.deceleration):
            profile = replace(profile, deceleration=in_force)
        self.deceleration[axis] = profile.deceleration
        return profile

    def can_stop(self, axis: int) -> bool:
        """Return True when ``axis`` can stop within its limits, as it moves now. Any thread.

        False for a moving axis whose position is not known.
        """
        return self._can_stop(axis, self.deceleration[axis])

    def _can_stop(self, axis: int, deceleration: float) -> bool:
        image = self._image
        # A device may measure no velocity.
        known = filter(math.isfinite, (image.velocity[axis], image.velocity_command[axis]))
        velocity, position = float(max(known, key=abs, default=0.0)), float(image.position[axis])
        command = float(image.position_command[axis])
        if (command - position) * velocity > 0.0:
            position = command  # the axis is behind it, and will get there
        room = room_to_stop(self._limits[axis], position, velocity, deceleration)
        return room > abs(velocity) * self._reaction_s
