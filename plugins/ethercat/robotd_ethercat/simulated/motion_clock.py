"""Time of the motors: in step with the outputs, on the computer's clock without them."""

from __future__ import annotations

from collections.abc import Sequence

from robotd_cia402.simulated import Motors
from robotd_ethercat.simulated.servo_drive import ServoDrive

_LOST_NS = 100_000_000  # without outputs for so long the motors run on the computer's clock
_DEFAULT_S = 0.004


class MotionClock:
    """Advances the motors of all drives of a line."""

    def __init__(self, machine: Motors, drives: Sequence[ServoDrive]) -> None:
        self._machine, self._drives = machine, drives
        self._outputs_ns: int | None = None

    def outputs(self, now_ns: int) -> float:
        """Advance by one period of the outputs, more if outputs were lost; return the period."""
        self._outputs_ns = now_ns
        period_s = self._period_s()
        self._machine.synchronise(now_ns, period_s)
        return period_s

    def is_idle(self, now_ns: int) -> bool:
        """Return True if no outputs come, after advancing to ``now_ns``."""
        if self._outputs_ns is not None and now_ns - self._outputs_ns < _LOST_NS:
            return False
        self._machine.free_run(now_ns)
        return True

    def _period_s(self) -> float:
        """Period of the first drive that has one: all drives share the frame."""
        periods = (drive.period_s() for drive in self._drives if drive.powered)
        return next((period for period in periods if period is not None), _DEFAULT_S)
