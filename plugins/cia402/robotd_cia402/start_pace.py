"""Pace of a start: its time limit, and a log line while its SDO transfers take long."""

from __future__ import annotations

import math

from robotd.api import NANOSECONDS, Clock, DeviceTimeout, get_logger

log = get_logger("cia402")

REPORT_INTERVAL_S = 5.0


class StartPace:
    """Counts SDO transfers of a start, and ends one that would exceed its time. Worker."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self.limit()

    def limit(self, limit_s: float = math.inf) -> None:
        """Begin a start of at most ``limit_s``; infinite: it has ended, and nothing is limited."""
        self._transfers, self._begin_ns, self._limit_s = 0, self._clock.now_ns(), limit_s
        self._report_s = REPORT_INTERVAL_S

    def note_transfer(self, step: str) -> None:
        """Count a transfer; ``step`` names node and object.

        Raises DeviceTimeout after the limit, with the time of a transfer and what to raise.
        """
        if math.isinf(self._limit_s):
            return
        passed_s = (self._clock.now_ns() - self._begin_ns) / NANOSECONDS
        each_s = passed_s / (self._transfers or 1)
        if passed_s > self._limit_s:
            raise DeviceTimeout(
                f"{step}: the start is not done after {self._limit_s:g} s,"
                f" {self._transfers} SDO transfers took {each_s:.2g} s each;"
                " raise engine.communication_timeout_s"
            )
        if passed_s >= self._report_s:
            self._report_s = passed_s + REPORT_INTERVAL_S
            log.info(
                "configuring takes long",
                step=step,
                transfers=self._transfers,
                each_s=round(each_s, 2),
                for_s=round(passed_s),
                limit_s=self._limit_s,
            )
        self._transfers += 1


def start_limit(timeout_s: float, sdo_timeout_s: float) -> float:
    """Return when a start has to fail that is to end, with its last transfers, in ``timeout_s``."""
    return max(timeout_s / 2, timeout_s - 2 * sdo_timeout_s)
