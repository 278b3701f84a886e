"""Loss of the device: its reason, and one log line for loss and return."""

from __future__ import annotations

from robotd.clock import NANOSECONDS
from robotd.device.connection import Connection
from robotd.device.process_image import ProcessImage
from robotd.log import get_logger

log = get_logger("control")


class DeviceLoss:
    """Loss of the device as the control loop sees it. Control-loop thread.

    Args:
        connection: state and fault of the device.
        image: live process image.
    """

    def __init__(self, connection: Connection, image: ProcessImage) -> None:
        self._connection, self._image = connection, image
        self._found: tuple[object, str] | None = None  # key and text of the reason
        self._since_ns = 0  # 0: it is not lost
        self._established = False  # in the period before

    def find(self, key: object, reason: str) -> str:
        """Return ``reason`` with the device's fault, which is read once for each ``key``."""
        if self._found is None or self._found[0] != key:
            fault = self._connection.fault
            self._found = key, reason if fault in reason else f"{reason}: {fault}"
        return self._found[1]

    def end(self) -> None:
        """Note that the values are fresh again."""
        self._found = None

    def report(self, time_ns: int) -> None:
        """Log once when the device is lost, and once when it is back.

        In the period in which a worker establishes the connection it may not be ready yet.
        """
        before, self._established = self._established, self._connection.established
        if self._connection.ready:
            if self._since_ns:
                lost_s = (time_ns - self._since_ns) / NANOSECONDS
                on = int(self._image.servo_on.sum())
                log.info("device is back", after_s=round(lost_s, 1), servos_on=on)
            self._since_ns = 0
        elif before and self._established and not self._since_ns:
            self._since_ns = time_ns
            reason = self._found[1] if self._found else self._connection.fault
            log.error("device lost", reason=reason)
