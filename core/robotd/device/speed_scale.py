"""Speed of all motion, from 0 to 100 %, and its pause."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable

from robotd.errors import InvalidArgument, NotReady
from robotd.log import get_logger

log = get_logger("speed")

MIN_SPEED = 0.01

SpeedListener = Callable[[float], None]


class SpeedScale:
    """Ratio of motion time to real time, set by an operator. Any thread.

    Trajectories and the base follow changes while they move, by ramps; moves, jogs and streams
    take the value at their start.

    Attributes:
        speed: as set, 0 or 0.01 to 1.
        paused: ``scale`` is 0 until ``resume``.
    """

    def __init__(self) -> None:
        self.speed = 1.0
        self.paused = False
        self._lock = threading.Lock()
        self._listeners: list[SpeedListener] = []

    @property
    def scale(self) -> float:
        """Speed in force: 0 while paused."""
        return 0.0 if self.paused else self.speed

    @property
    def text(self) -> str:
        """Describe it as "paused (30 %)" or "30 %"."""
        percent = f"{100.0 * self.speed:g} %"
        return f"paused ({percent})" if self.paused else percent

    def set(self, speed: float) -> None:
        """Set the speed, also while paused. Raises InvalidArgument."""
        if not (speed == 0.0 or MIN_SPEED <= speed <= 1.0) or math.isnan(speed):
            raise InvalidArgument(f"speed {speed:g} is neither 0 nor {MIN_SPEED:g} to 1")
        self._change(speed=speed)

    def pause(self) -> None:
        """Bring motion to rest on its path, to be continued; twice is not an error."""
        self._change(paused=True)

    def resume(self) -> None:
        """Continue at the speed as set."""
        self._change(paused=False)

    @property
    def rejection(self) -> str:
        """Text that rejects motion which keeps its scale; "" while that is not 0."""
        if self.scale:
            return ""
        what, advice = ("paused", "resume") if self.paused else ("at speed 0 %", "speed 100")
        return f"motion is {what}; robotd {advice} allows it again"

    def at_start(self) -> float:
        """Return the scale for a motion that keeps it. Raises NotReady while it is 0."""
        scale = self.scale
        if not scale:
            raise NotReady(self.rejection)
        return scale

    def on_change(self, listener: SpeedListener) -> None:
        """Call ``listener(scale)`` now and on every change, from the thread that causes it."""
        with self._lock:
            self._listeners.append(listener)
            listener(self.scale)

    def _change(self, *, speed: float | None = None, paused: bool | None = None) -> None:
        """Change what is not None."""
        with self._lock:
            speed = self.speed if speed is None else speed
            paused = self.paused if paused is None else paused
            if (speed, paused) == (self.speed, self.paused):
                return
            self.speed, self.paused = speed, paused
            log.info("speed changed", speed=self.text)
            for listener in self._listeners:
                listener(self.scale)
