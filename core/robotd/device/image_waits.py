"""Waits for the image to show what a command has done."""

from __future__ import annotations

from collections.abc import Callable

from robotd.clock import Clock, wait_until
from robotd.device.connection import Connection
from robotd.device.process_image import ProcessImage
from robotd.errors import NotReady

IMAGE_LATENCY_S = 0.1  # for the image, a period or two behind, to show what a driver has reported
FEEDBACK_LATENCY_PERIODS = 3  # slow feedback periods in which it does
FIRST_VALUES_TIMEOUT_S = 1.0  # that a command needs: of a new connection, or after a stall


class ImageWaits:
    """Waits of commands for the image, which is a period or two behind the device. Any worker.

    ``shown_s``: time in which the image shows what a driver has reported.
    """

    def __init__(
        self, image: ProcessImage, connection: Connection, clock: Clock, feedback_period_s: float
    ) -> None:
        self.shown_s = max(IMAGE_LATENCY_S, FEEDBACK_LATENCY_PERIODS * feedback_period_s)
        self._image, self._connection, self._clock = image, connection, clock

    def until(self, condition: Callable[[], bool], at_least_s: float = 0.0) -> None:
        """Wait until the image shows ``condition``, by which the next command is judged.

        Not for long, and no longer than the device is ready.
        """
        timeout_s = max(at_least_s, self.shown_s)
        wait_until(lambda: condition() or not self._connection.ready, timeout_s, self._clock)

    def for_newer(self, time_ns: int, at_least_s: float = 0.0) -> None:
        """Wait for an image that is newer than ``time_ns``."""
        self.until(lambda: self.is_newer(time_ns), at_least_s)

    def require_newer(self, time_ns: int) -> None:
        """Wait for an image that is newer than ``time_ns``. Raises NotReady: none comes."""
        self.for_newer(time_ns, FIRST_VALUES_TIMEOUT_S)
        if not self.is_newer(time_ns):
            self._connection.require_ready()
            raise NotReady("the device has sent no values since the last command")

    def is_newer(self, time_ns: int) -> bool:
        """Return True when the image is newer than ``time_ns``; as new as its values."""
        return self._image.fresh_ns > time_ns
