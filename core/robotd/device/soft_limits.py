"""Soft-limit guard: stops a jog in time to stay inside the position limits."""

from __future__ import annotations

import math

from robotd.device.axes import Axes
from robotd.device.process_image import ProcessImage
from robotd.device.state import Operation
from robotd.log import get_logger
from robotd.motion.limits import room_to_stop

log = get_logger("axes")

REACTION_PERIODS = 3.0  # values are a period old, a stop begins a period later; one to spare


class SoftLimitGuard:
    """Stops velocity commands so that their axes come to rest within the position limits."""

    def __init__(self, axes: Axes, period_s: float) -> None:
        self._axes = axes
        self._reaction_s = REACTION_PERIODS * period_s + axes.feedback_period_s
        self._ended: set[int] = set()  # axes whose velocity command was ended, until it shows

    def look(self, image: ProcessImage) -> None:
        """Stop what has just room enough left. Control loop, once a period."""
        operations = image.operation.tolist()
        if Operation.VELOCITY not in operations:
            self._ended.clear()
            return
        jogged = [axis for axis, each in enumerate(operations) if each == Operation.VELOCITY]
        ended = [axis for axis in jogged if self._ends(axis)]
        if ended:
            self._axes.stops.request(ended)
        new = [self._axes.names[axis] for axis in ended if axis not in self._ended]
        self._ended = set(ended)
        if new:
            log.warning("velocity command ended before the position limit", axes=new)

    def _ends(self, axis: int) -> bool:
        axes, image = self._axes, self._axes.image
        # A device may measure no velocity.
        known = filter(math.isfinite, (image.velocity[axis], image.velocity_command[axis]))
        velocity, position = float(max(known, key=abs, default=0.0)), float(image.position[axis])
        room = room_to_stop(axes.limits[axis], position, velocity, axes.deceleration[axis])
        return not room > abs(velocity) * self._reaction_s  # also of a position that is not known
