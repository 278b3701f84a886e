"""Motions that begin unless they are stopped meanwhile."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from robotd.device.command_effect import CommandEffect
from robotd.device.drivers import AxisDriver
from robotd.device.stop_latch import StopLatch
from robotd.errors import NotReady


class MotionStarts:
    """Count of stops: a driver may take its time, and no stop waits for it.

    Any worker.

    Args:
        driver: stops what began too late.
        latch: forbids all motion while it is engaged.
        effect: learns of each motion.
        axes: number of axes.
    """

    def __init__(
        self, driver: AxisDriver, latch: StopLatch, effect: CommandEffect, axes: int
    ) -> None:
        self._driver, self._latch, self._effect = driver, latch, effect
        self._stops = [0] * axes

    @property
    def stops(self) -> list[int]:
        """Number of stops of each axis so far, to be compared by ``begun``."""
        return list(self._stops)

    def note_stop(self, axes: Sequence[int]) -> None:
        """Note that ``axes`` are to be stopped now."""
        for axis in axes:
            self._stops[axis] += 1

    @contextmanager
    def begun(self, axis: int, stops: Sequence[int]) -> Iterator[None]:
        """Begin a motion in the block. Raises NotReady after a stop since ``stops``."""
        self._check(axis, stops)
        yield
        self._effect.note_motion()
        try:
            self._check(axis, stops)
        except NotReady:
            self._driver.stop([axis])
            raise

    def _check(self, axis: int, stops: Sequence[int]) -> None:
        self._latch.check()
        if self._stops[axis] != stops[axis]:
            raise NotReady("stopped before the motion began")
