"""Reads the process image each period and judges the age of its values."""

from __future__ import annotations

from robotd.clock import NANOSECONDS
from robotd.control.period_deadlines import PeriodDeadlines
from robotd.device.drivers import AxisDriver
from robotd.device.process_image import ProcessImage
from robotd.errors import RobotdError
from robotd.log import get_logger

log = get_logger("control")


class ImageReader:
    """Fills the process image from the driver. Control-loop thread.

    Args:
        driver: of the axes.
        image: the live process image.
        stale_after_s: age of values that are not trusted any more.
        deadlines: of the control loop; a driver may shift the next one.

    Attributes:
        failure: reason of the last read that failed; None: it succeeded.
    """

    def __init__(
        self,
        driver: AxisDriver,
        image: ProcessImage,
        stale_after_s: float,
        deadlines: PeriodDeadlines,
    ) -> None:
        self.failure: str | None = None
        self._driver, self._image, self._deadlines = driver, image, deadlines
        self._stale_after_ns = round(stale_after_s * NANOSECONDS)
        self._since_ns = 0  # first read of this communication

    def read(self, time_ns: int) -> int:
        """Fill the image; return the nominal time of the period that began at ``time_ns``.

        That is fixed after the driver's ``read``, which may be slow. An exception of the driver is
        logged once.
        """
        image = self._image
        image.begin_write()
        try:
            self._driver.read(image)
            image.stamp_ns = nominal_ns = self._deadlines.nominal(time_ns)
            if image.shift_ns:
                self._deadlines.shift(image.shift_ns)
                image.shift_ns = 0
            self.failure = None
        except Exception as error:
            expected = isinstance(error, RobotdError)
            if self.failure is None and not expected:
                log.error("reading the process image failed", reason=str(error))
                log.debug("traceback of the failed read", exc_info=error)
            self.failure = str(error) if expected else f"{type(error).__name__}: {error}"
            nominal_ns = self._deadlines.nominal(time_ns)
        finally:
            image.end_write()
        self._since_ns = self._since_ns or nominal_ns
        return nominal_ns

    def staleness(self, time_ns: int) -> str | None:
        """Return why the values are too old to be trusted; None: they are fresh."""
        age_ns = time_ns - max(self._image.fresh_ns, self._since_ns)
        if age_ns <= self._stale_after_ns:
            return None
        return self.failure or f"the fieldbus values are {age_ns / 1e6:.0f} ms old"

    def forget(self) -> bool:
        """Clear the image after the end of communication; return False when it was cleared."""
        if not self._since_ns:
            return False
        self._since_ns = 0
        self._image.forget()
        return True
