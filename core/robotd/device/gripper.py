"""A pneumatic gripper on one output bit, and the input that shows a part."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass

from robotd.clock import NANOSECONDS, Clock, wait_until
from robotd.descriptor import GripperSettings
from robotd.device.io import Io
from robotd.errors import InvalidArgument

TOLERANCE = 0.05  # share of the stroke within which a position counts as reached
SETTLE_S = 0.05  # from the end of the travel to the sensor's answer


@dataclass(frozen=True)
class GripperState:
    """State of the fingers at the end of a move.

    Attributes:
        position_m: of each finger, as far as it is known.
        reached: they are at the commanded position.
        stalled: they were stopped by a part before the commanded position.
        at_rest: they have stopped; False: the move was canceled or replaced on the way.
    """

    position_m: float
    reached: bool
    stalled: bool
    at_rest: bool


class Gripper:
    """Opens and closes by an output bit; where the fingers are follows from that bit.

    The valve has no sensor of position: the position is what the command leads to, not what was
    felt. An input may show that a part is held.

    Args:
        io: of the robot.
        settings: of the descriptor.
        clock: to wait by.

    Attributes:
        joints: names of the fingers.
    """

    def __init__(self, io: Io, settings: GripperSettings, clock: Clock) -> None:
        self.joints = tuple(settings.joints)
        self._io, self._settings, self._clock = io, settings, clock
        self._byte = settings.output_byte
        self._bit = settings.output_bit
        self._commanded = io.output_watcher(self._byte, self._bit)
        sensor = settings.part_sensor
        self._holds_part = (
            io.input_watcher(sensor.input_byte, sensor.input_bit) if sensor else lambda: False
        )
        self._travel_ns = settings.travel_time_s * NANOSECONDS
        self._closed = 0.0
        self._last_ns = 0
        self._moves = 0  # counts them: the newest one replaces the others
        self._lock = threading.Lock()

    def command(self, closed: bool) -> int:
        """Close (True) or open the gripper; any worker. Raises NotReady without the engine.

        Returns the number of the move that this begins.
        """
        with self._lock:
            self._moves += 1
            self._io.set_output_bit(self._byte, self._bit, closed)
            return self._moves

    def checked(self, position_m: float) -> float:
        """Return a commanded finger position.

        Raises InvalidArgument where it is not between open and closed, with the margin of
        ``TOLERANCE``.
        """
        low, high = sorted((self._settings.open_m, self._settings.closed_m))
        margin = TOLERANCE * (high - low)
        if not (math.isfinite(position_m) and low - margin <= position_m <= high + margin):
            raise InvalidArgument(f"gripper: position {position_m} m is outside {low} to {high} m")
        return position_m

    def move(self, position_m: float, is_canceled: Callable[[], bool]) -> GripperState:
        """Open or close, whichever end is nearer, and wait until the fingers are at rest.

        Any worker. A later command replaces it. Canceling leaves the output as it is: a valve has
        no position between its ends. Raises NotReady without the engine.

        Args:
            position_m: of each finger, from ``checked``.
            is_canceled: ends the wait.
        """
        open_m, closed_m = self._settings.open_m, self._settings.closed_m
        closes = abs(position_m - closed_m) < abs(position_m - open_m)
        begin_m = open_m + (closed_m - open_m) * self._closed
        move, began_ns = self.command(closes), self._clock.now_ns()

        def interrupted() -> bool:
            return is_canceled() or self._moves != move

        held = closes and self._settings.part_sensor is not None
        travel_s = self._settings.travel_time_s + (SETTLE_S if held else 0.0)
        wait_until(lambda: interrupted() or (held and self._holds_part()), travel_s, self._clock)
        end_m = closed_m if closes else open_m
        if held and self._holds_part():
            share = self._share(began_ns)
            return GripperState(begin_m + (end_m - begin_m) * share, False, True, True)
        if interrupted() and self._share(began_ns) < 1.0:
            position = begin_m + (end_m - begin_m) * self._share(began_ns)
            return GripperState(position, False, False, False)
        near = abs(end_m - position_m) <= TOLERANCE * abs(closed_m - open_m)
        return GripperState(end_m, near, not near, True)

    @property
    def is_commanded_closed(self) -> bool:
        """Commanded state of the output bit. Any thread."""
        return self._commanded()

    def closed(self, time_ns: int) -> float:
        """Cycle: how far the fingers are closed at the monotonic ``time_ns``, 0 … 1.

        They travel at constant speed, ``travel_time_s`` from one end to the other.
        """
        self._closed = self.travelled(self._closed, time_ns - self._last_ns)
        self._last_ns = time_ns
        return self._closed

    def travelled(self, closed: float, time_ns: int) -> float:
        """Return how far fingers at ``closed`` are closed after ``time_ns``. Any thread."""
        target = 1.0 if self._commanded() else 0.0
        step = time_ns / self._travel_ns if self._travel_ns else 1.0
        return closed + min(max(target - closed, -step), step)

    def _share(self, began_ns: int) -> float:
        """Return the part of the way that has passed since ``began_ns``."""
        if not self._travel_ns:
            return 1.0
        return min((self._clock.now_ns() - began_ns) / self._travel_ns, 1.0)
