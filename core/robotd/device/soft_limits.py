"""Soft-limit guard: stops axes at, and outside of, their position limits."""

from __future__ import annotations

from collections.abc import Sequence

from robotd.device.axes import Axes
from robotd.device.process_image import ProcessImage
from robotd.device.state import Operation
from robotd.log import get_logger

log = get_logger("axes")


class SoftLimitGuard:
    """Stops velocity commands so that their axes come to rest within the position limits.

    An axis that has left its limits all the same, in a command of its own, is stopped once: it may
    come back. Joints in a stream or a trajectory are judged by their source.

    ``streamed``: axes that are stopped in a stream, too.
    """

    def __init__(self, axes: Axes, streamed: Sequence[int] = ()) -> None:
        self._axes, self._streamed = axes, frozenset(streamed)
        self._measured = [limits.measured for limits in axes.limits]
        self._outside = [True] * len(axes)  # until they are seen inside
        self._ended: set[int] = set()  # axes whose velocity command was ended, until it shows

    def look(self, image: ProcessImage) -> None:
        """Stop axes that have just room enough to brake. Control loop, once a period."""
        operations = image.operation.tolist()
        self._stop_outside(image, operations)
        if Operation.VELOCITY not in operations:
            self._ended.clear()
            return
        jogged = [
            axis for axis, operation in enumerate(operations) if operation == Operation.VELOCITY
        ]
        ended = [axis for axis in jogged if not self._axes.braking.can_stop(axis)]
        if ended:
            self._axes.stops.request(ended)
        new = [self._axes.names[axis] for axis in ended if axis not in self._ended]
        self._ended = set(ended)
        if new:
            log.warning("velocity command ended before the position limit", axes=new)

    def _stop_outside(self, image: ProcessImage, operations: Sequence[int]) -> None:
        # As lists: for the axes of a robot several times faster than arrays.
        positions = image.position.tolist()
        outside = [
            position < lower or position > upper
            for position, (lower, upper) in zip(positions, self._measured, strict=True)
        ]
        if outside == self._outside:
            return
        for axis, (is_out, was_out) in enumerate(zip(outside, self._outside, strict=True)):
            if was_out or not is_out:
                continue
            streams = operations[axis] == Operation.STREAM and axis in self._streamed
            if streams or operations[axis] in (Operation.POSITION, Operation.VELOCITY):
                excess = self._axes.limits[axis].excess(positions[axis])
                log.error("stopped outside its limits", axis=self._axes.names[axis], reason=excess)
                self._axes.stops.request([axis])
        self._outside = outside
