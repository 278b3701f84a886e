"""Wait until the process image shows the effect of a command."""

from __future__ import annotations

from collections.abc import Callable

from robotd.clock import Clock, wait_until
from robotd.device.connection import Connection
from robotd.device.process_image import ProcessImage

SHOWN_S = 0.1  # for the image, a period or two behind, to show what a driver has reported
SAMPLES = 3  # slow feedback periods in which it does
FIRST_S = 1.0  # for the first values of a device that has begun to communicate


class CommandEffect:
    """Lets the image, a period behind the device, catch up with commands. Workers only.

    Where feedback is slower than the control loop, an image is as new as its values.

    Args:
        image: the live process image.
        connection: no wait lasts longer than the device is ready.
        clock: to wait by.
        feedback_period_s: as of ``AxisDriver``.
    """

    def __init__(
        self,
        image: ProcessImage,
        connection: Connection,
        clock: Clock,
        feedback_period_s: float = 0.0,
    ) -> None:
        self._image, self._connection, self._clock = image, connection, clock
        self._slow = feedback_period_s > 0.0
        self._shown_s = max(SHOWN_S, SAMPLES * feedback_period_s)
        self._commanded_ns = 0

    def note_motion(self) -> None:
        """Note that a motion command was given now."""
        self._commanded_ns = self._clock.now_ns()

    def wait_for(self, condition: Callable[[], bool]) -> None:
        """Wait until ``condition``, by which the next command is judged; not for long."""
        wait_until(lambda: condition() or not self._connection.ready, self._shown_s, self._clock)

    def wait_for_first(self, condition: Callable[[], bool]) -> None:
        """Wait for ``condition`` on values that a new connection may not have reported yet."""
        timeout_s = max(FIRST_S, self._shown_s)
        wait_until(lambda: condition() or not self._connection.ready, timeout_s, self._clock)

    def wait_for_motion(self) -> None:
        """Wait for an image that is newer than the last motion command."""
        self._wait_for_newer(self._commanded_ns)

    def wait_for_next(self) -> None:
        """Wait for an image that was read after now."""
        self._wait_for_newer(self._clock.now_ns())

    def _wait_for_newer(self, time_ns: int) -> None:
        image = self._image
        self.wait_for(lambda: (image.fresh_ns if self._slow else image.stamp_ns) > time_ns)
