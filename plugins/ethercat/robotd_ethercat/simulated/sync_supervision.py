"""Supervision of process data by a slave: watchdog, SYNC0 and clock difference."""

from __future__ import annotations

from robotd_ethercat.simulated import registers as reg
from robotd_ethercat.simulated.al_state import AlCode
from robotd_ethercat.simulated.slave_controller import SlaveController

_MISSED, _GOOD = 3, 1  # added for a missed SYNC0 period, subtracted for a good one (ETG.1020)


class SyncSupervision:
    """Checks in Op that outputs come in time and the clock is synchronous.

    Time in which the simulation itself did not run is left out: call ``skip``.

    Attributes:
        error_limit: sync error counter limit, as object 0x10F1:02; 0: periods without outputs
            are allowed, as patient drives do.
    """

    def __init__(self, controller: SlaveController, error_limit: int) -> None:
        self._controller = controller
        self.error_limit = error_limit
        self._pulse: int | None = None
        self._errors = 0

    def begin(self, now_ns: int) -> None:
        """Start supervision: the slave enters Op."""
        self._controller.watchdog_ns = now_ns
        self._controller.clock.difference_ns = None
        self._pulse, self._errors = None, 0

    def skip(self, paused_ns: int) -> None:
        """Leave out a pause of the simulation."""
        self._controller.watchdog_ns += paused_ns
        cycle = self._controller.clock.sync0_cycle_ns
        if self._pulse is not None and cycle:
            self._pulse += -(-paused_ns // cycle)

    def outputs(self, now_ns: int) -> AlCode:
        """Check the arrival of outputs; return AlCode.NONE if all is well."""
        clock = self._controller.clock
        if not clock.sync0_active:
            return AlCode.NONE
        pulse = clock.sync0_count(now_ns)
        if pulse is None:
            return AlCode.FATAL_SYNC_ERROR
        if self.error_limit and self._misses_periods(pulse):
            return AlCode.SYNCHRONISATION_ERROR
        difference_ns = abs(clock.difference_ns or 0)
        return AlCode.PLL_ERROR if 2 * difference_ns > clock.sync0_cycle_ns else AlCode.NONE

    def _misses_periods(self, pulse: int) -> bool:
        """Count periods without outputs; return True above the limit."""
        before, self._pulse = self._pulse, pulse
        missed = 0 if before is None else max(0, pulse - before - 1)
        self._errors = max(0, self._errors + _MISSED * missed - (0 if missed else _GOOD))
        return self._errors > self.error_limit

    def tick(self, now_ns: int) -> AlCode:
        """Check the process data watchdog."""
        controller = self._controller
        time_ns = controller.watchdog_time_ns()
        expired = (
            controller.sync_managers[2].watchdog
            and time_ns > 0
            and now_ns - controller.watchdog_ns > time_ns
        )
        controller.put(reg.PROCESS_DATA_WATCHDOG_STATUS, 2, int(not expired))
        if expired:
            controller.count_error(reg.PROCESS_DATA_WATCHDOG_COUNTER)
        return AlCode.WATCHDOG if expired else AlCode.NONE
