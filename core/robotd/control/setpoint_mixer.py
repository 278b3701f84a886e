"""Mixes the setpoints of all sources and streams one per axis and control period."""

from __future__ import annotations

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS, Clock, MonotonicClock
from robotd.control.completion import Outcome
from robotd.control.period_timing import LoopStatistics
from robotd.control.source_slot import SourceSlot
from robotd.device.drivers import AxisDriver
from robotd.device.process_image import ProcessImage
from robotd.device.state import Operation, Underrun
from robotd.errors import LateSetpoint


class SetpointMixer:
    """Slots of all groups of axes; sends their setpoints together. Control-loop thread.

    Args:
        axes: number of axes of the device.
        clock: of the device and of the control loop; None: monotonic.

    Attributes:
        due_ns: due time of the last setpoints; 0 before the first period.
        sent_ns: due time of the last setpoints that the device got; 0 before the first.
        extrapolates: the device extrapolates missing setpoints; late ones are not sent then.
        stats: of the control loop; counts the setpoints that came too late and were not sent.
    """

    def __init__(
        self, driver: AxisDriver, axes: int, rate_hz: float, clock: Clock | None = None
    ) -> None:
        self.period_ns = round(NANOSECONDS / rate_hz)
        self.due_ns = 0
        self.sent_ns = 0
        self.stats = LoopStatistics()
        self.extrapolates = driver.underrun is Underrun.EXTRAPOLATE
        self._buffers = driver.stream_buffer_s > 0.0
        self._driver = driver
        self._clock = clock or MonotonicClock()
        self._setpoints: FloatArray = np.full((2, axes), np.nan)
        self._position, self._velocity = self._setpoints
        self._slots: list[SourceSlot] = []

    def slot(self) -> SourceSlot:
        """Return a new slot for a group of axes; before the control loop starts."""
        slot = SourceSlot(self.period_ns)
        self._slots.append(slot)
        return slot

    @property
    def active(self) -> bool:
        """A source moves axes, or waits to. Any thread."""
        return any(slot.active for slot in self._slots)

    def end_all(self, outcome: Outcome, reason: str) -> None:
        """Request the end of all sources, each by its own controlled stop. Any thread."""
        for slot in self._slots:
            for source in slot.active:
                source.completion.request(outcome, reason)

    def advance(self, time_ns: int, image: ProcessImage) -> None:
        """Run one period, with setpoints due at ``time_ns + period_ns``."""
        self.due_ns = time_ns + self.period_ns
        if len(self._slots) > 1:
            self._hold_idle_axes(image)
        streamed = []
        for slot in self._slots:
            source = slot.select(time_ns)
            if source is not None and source.advance(time_ns, self.period_ns, image):
                self._setpoints[:, source.columns] = source.setpoint[:2]
                streamed.append(source)
        if not streamed:
            return
        try:
            self._check_late()
            self._driver.stream(self._position, self._velocity, self.due_ns)
        except LateSetpoint:  # the device has continued without it
            self.stats.late_setpoints += 1
            return
        image.setpoint[:] = self._setpoints
        self.sent_ns = self.due_ns
        for source in streamed:
            source.sent(self.due_ns)

    def device_lost(self, reason: str) -> None:
        """Fail everything that runs: the device cannot be reached. Also the watchdog's thread."""
        for slot in self._slots:
            slot.device_lost(reason)

    def _hold_idle_axes(self, image: ProcessImage) -> None:
        """Let axes that do not stream hold their command until their first setpoint.

        Another group may be streaming when a worker has just claimed these axes.
        """
        idle = image.operation != Operation.STREAM
        np.copyto(self._position, image.position_command, where=idle)
        np.copyto(self._velocity, 0.0, where=idle)

    def _check_late(self) -> None:
        """Raise LateSetpoint where the device would not take the setpoint.

        It extrapolates, and half of the period has passed; or the setpoints that it holds have run
        dry in motion, and its path has to wait.
        """
        if self.extrapolates and self._clock.now_ns() > self.due_ns - self.period_ns // 2:
            raise LateSetpoint("more than half of the period has passed")
        if self._buffers and self._driver.stream_ran_dry(self.due_ns):
            raise LateSetpoint("the device has executed all setpoints that it held")
