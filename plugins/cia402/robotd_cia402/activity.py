"""Operation of one axis: what is being executed, and how it ended."""

from __future__ import annotations

from robotd.api import Operation

_REST_VELOCITY_RAD_S = 0.01  # measured velocity of an axis at rest
_REST_FRAMES = 3  # frames at that velocity that make a standstill


class Activity:
    """Operation in progress. Begun by workers, ended by the control loop.

    Attributes:
        operation: as in the process image.
        complete: the last motion has reached its end.
        home_done: the axis has been homed since it was configured.
        streaming: setpoints come from ``AxisDriver.stream``.
        stops: number of stops that were requested, also of an idle axis.
    """

    def __init__(self) -> None:
        self.operation = Operation.IDLE
        self.complete = self.home_done = self.streaming = False
        self.stops = 0
        self._resting_frames = 0

    @property
    def is_idle(self) -> bool:
        return self.operation is Operation.IDLE

    def begin(self, operation: Operation) -> None:
        """Worker: ``operation`` runs from now on."""
        self.operation = operation
        self.streaming = operation is Operation.STREAM

    def begin_stop(self) -> None:
        """A stop replaces what runs; it ends at rest."""
        self.begin(Operation.STOPPING)
        self.complete = False
        self._resting_frames = 0

    def end(self) -> None:
        """Idle from now on."""
        self.begin(Operation.IDLE)

    def is_at_rest(self, velocity: float, *, commanded: bool) -> bool:
        """Control loop: the motor has been slow for some frames.

        Args:
            velocity: measured, rad/s or m/s.
            commanded: the setpoint still moves, so the axis does not rest.
        """
        slow = not commanded and abs(velocity) < _REST_VELOCITY_RAD_S
        self._resting_frames = self._resting_frames + 1 if slow else 0
        return self._resting_frames >= _REST_FRAMES
