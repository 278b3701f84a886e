"""A pneumatic gripper on one output bit."""

from __future__ import annotations

from robotd.clock import NANOSECONDS
from robotd.descriptor import GripperSettings
from robotd.device.io import Io


class Gripper:
    """Opens and closes by an output bit; where the fingers are follows from that bit.

    The valve has no sensor: the position is what the command leads to, not what was felt.
    """

    def __init__(self, io: Io, settings: GripperSettings) -> None:
        self.joints = tuple(settings.joints)
        self._io = io
        self._byte = settings.output_byte
        self._bit = settings.output_bit
        self._commanded = io.output_watcher(self._byte, self._bit)
        self._travel_ns = settings.travel_time_s * NANOSECONDS
        self._closed = 0.0
        self._last_ns = 0

    def command(self, closed: bool) -> None:
        """Close (True) or open the gripper; any worker. Raises NotReady without the engine."""
        self._io.set_output_bit(self._byte, self._bit, closed)

    @property
    def is_commanded_closed(self) -> bool:
        """Commanded state of the output bit. Any thread."""
        return self._commanded()

    def closed(self, time_ns: int) -> float:
        """Cycle: how far the fingers are closed at the monotonic ``time_ns``, 0 … 1.

        They travel at constant speed, ``travel_time_s`` from one end to the other.
        """
        target = 1.0 if self._commanded() else 0.0
        step = (time_ns - self._last_ns) / self._travel_ns if self._travel_ns else 1.0
        self._closed += min(max(target - self._closed, -step), step)
        self._last_ns = time_ns
        return self._closed
