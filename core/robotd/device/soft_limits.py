"""Soft-limit guard: stops a jog in time to stay inside the position limits."""

from __future__ import annotations

from collections.abc import Sequence

from robotd.device.axes import Axes
from robotd.device.drivers import AxisDriver
from robotd.device.process_image import ProcessImage
from robotd.device.state import Operation
from robotd.log import get_logger
from robotd.motion.limits import room_to_stop

log = get_logger("axes")

REACTION_PERIODS = 3.0  # values are a period old, a stop begins a period later; one to spare


class SoftLimitGuard:
    """Stops velocity commands so that their axes come to rest within the position limits.

    Args:
        axes: whose limits and commands count.
        driver: stops; the control loop may call ``stop``, which only starts one.
        period_s: of the control loop.
    """

    def __init__(self, axes: Axes, driver: AxisDriver, period_s: float) -> None:
        self._axes = axes
        self._driver = driver
        self._reaction_s = REACTION_PERIODS * period_s + driver.feedback_period_s

    def look(self, image: ProcessImage) -> None:
        """Cycle thread, once a period: stop what has just room enough left."""
        operations = image.operation.tolist()
        if Operation.VELOCITY in operations:
            jogged = [axis for axis, each in enumerate(operations) if each == Operation.VELOCITY]
            self._stop([axis for axis in jogged if self._ends(axis)])

    def _ends(self, axis: int) -> bool:
        axes, image = self._axes, self._axes.image
        velocity = max(float(image.velocity[axis]), float(image.velocity_command[axis]), key=abs)
        position = float(image.position[axis])
        room = room_to_stop(axes.limits[axis], position, velocity, axes.jog_deceleration[axis])
        return room <= abs(velocity) * self._reaction_s

    def _stop(self, axes: Sequence[int]) -> None:
        if axes:
            self._driver.stop(axes)
            names = [self._axes.names[axis] for axis in axes]
            log.warning("velocity command ended before the position limit", axes=names)
