"""Axes of a bus with servos; moves, velocity commands and stops are made by ``ProfiledAxes``."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from robotd.api import (
    NANOSECONDS,
    AxisLimits,
    DeviceContext,
    FloatArray,
    IntArray,
    NotReady,
    ProcessImage,
    ProfiledAxes,
)
from robotd_serial_servo.device import ServoDevice
from robotd_serial_servo.options import PlannedServo, ServoPlan
from robotd_serial_servo.servo_faults import TEXTS, Fault
from robotd_serial_servo.switching import catch, clear, energise

READ_ONLY = "the servos of this arm stay off: it is moved by hand (option free)"
LATE_PERIODS = 2.5  # since the last exchange, until targets wait for the next one
CATCH_S = 3.0  # in which an arm that was let go has to come to rest
FALLS = (
    "The arm falls when its servos are switched off: support it, or move it to a rest pose first"
)


class ServoAxes(ProfiledAxes):
    """One servo for each axis.

    Args:
        fault_text: fault bits of the family in words.
        without_bus: caution about what the servos do when this computer stops.
    """

    def __init__(
        self,
        device: ServoDevice,
        context: DeviceContext[ServoPlan],
        fault_text: Callable[[int], str],
        without_bus: str,
    ) -> None:
        robot = context.robot
        super().__init__(
            robot.axes,
            1.0 / robot.cycle.rate_hz,
            context.clock,
            feedback_lost_s=robot.engine.stale_after_s,
        )
        self._device, self._plan, self._fault_text = device, context.options, fault_text
        self._without_bus = without_bus
        self._shown: IntArray = np.zeros(robot.axes, np.int64)  # activations
        self._uncaught: dict[int, str] = {}  # why an axis is off that was to be held

    @property
    def read_only(self) -> str:
        return READ_ONLY if self._plan.options.free else ""

    @property
    def feedback_period_s(self) -> float:
        return self._plan.options.exchange_period_s

    @property
    def response_s(self) -> float:
        return self._plan.options.response_s

    @property
    def device_limits(self) -> Sequence[AxisLimits]:
        return [_limits(servo) for servo in self._plan.servos]

    @property
    def cautions(self) -> Sequence[str]:
        return () if self._plan.options.free else (FALLS, self._without_bus)

    def read_feedback(self, image: ProcessImage) -> None:
        exchange = self._device.exchange
        if exchange is None or not self._device.communicating:
            return
        guided = exchange.let_go.copy()
        # Before the feedback, which shows that they are held.
        caught = {axis: job for axis, job in guided.items() if job and job.done.is_set()}
        feedback = exchange.feedback
        image.fresh_ns = feedback.time_ns
        image.position[:] = feedback.position
        image.velocity[:] = feedback.velocity
        image.servo_on[:] = feedback.torque
        # What a servo that comes on, or is back, holds may differ from its position. A bus thread
        # that is late has not sent the last targets.
        waited_s = (self.clock.now_ns() - feedback.ended_ns) / NANOSECONDS
        late = waited_s > LATE_PERIODS * self._plan.options.exchange_period_s
        image.silent[:] = feedback.silent | (feedback.activation > self._shown) | late
        known = image.silent & np.isfinite(feedback.goal)
        np.copyto(image.position_command, feedback.goal, where=known)
        image.offline[:] = feedback.offline
        image.home_done[:] = True
        self._shown = feedback.activation
        if feedback.alarm.any() or image.amp_alarm.any():
            image.alarm_code[:] = feedback.alarm
            image.amp_alarm[:] = feedback.alarm != 0
            for axis, code in enumerate(feedback.alarm.tolist()):
                image.reason[axis] = self._text(code)
        for axis in guided:
            lost = guided[axis] is None and (feedback.alarm[axis] or feedback.offline[axis])
            if lost or axis in caught:
                exchange.let_go.pop(axis, None)
        for axis, job in caught.items():
            if job.error is not None:
                self._uncaught[axis] = str(job.error)
        for axis, reason in self._uncaught.copy().items():
            if feedback.torque[axis]:
                self._uncaught.pop(axis, None)
            image.reason[axis] = "" if feedback.torque[axis] else image.reason[axis] or reason

    def send_targets(self, positions: FloatArray) -> None:
        exchange = self._device.exchange
        if exchange is not None and self._device.communicating:
            exchange.send(positions, self._shown)

    def let_go(self, axes: Sequence[int], timeout_s: float) -> None:
        exchange = self._device.connected
        for job in [exchange.switch_off(axis) for axis in axes]:
            exchange.wait(job, timeout_s)
        exchange.let_go |= dict.fromkeys(axes)

    def catch(self, axes: Sequence[int]) -> None:
        exchange, deadline_ns = self._device.connected, self._deadline_ns(CATCH_S)
        if not self._device.communicating:
            return  # all servos go off, and stay off
        # An axis that was let go before communication began again is off, and stays off.
        for axis in [axis for axis in axes if axis in exchange.let_go]:
            record = exchange.records[axis]
            steps = catch(exchange.bus, record, self.clock, deadline_ns, record.releases)
            exchange.let_go[axis] = exchange.submit(steps)

    def is_let_go(self, axis: int) -> bool:
        exchange = self._device.exchange
        return exchange is not None and axis in exchange.let_go

    def servo(self, axis: int, on: bool, timeout_s: float) -> None:
        exchange = self._device.connected
        if on and not self._device.communicating:
            raise NotReady("the servos do not communicate")
        if on and axis in exchange.let_go:
            raise NotReady("it is guided by hand, or being held again")
        catching = None if on else exchange.let_go.pop(axis, None)
        if on:
            record, deadline_ns = exchange.records[axis], self._deadline_ns(timeout_s)
            job = exchange.submit(energise(exchange.bus, record, self.clock, deadline_ns))
        else:
            job = exchange.switch_off(axis)
        exchange.wait(job, timeout_s)
        if catching is not None:  # it ends by this, with a switch-off of its own
            catching.done.wait(timeout_s)

    def clear_alarm(self, axis: int, timeout_s: float) -> None:
        exchange = self._device.connected
        steps = clear(
            exchange.bus, exchange.records[axis], self.clock, self._deadline_ns(timeout_s)
        )
        exchange.wait(exchange.submit(steps), timeout_s)

    def _deadline_ns(self, timeout_s: float) -> int:
        return self.clock.now_ns() + round(timeout_s * NANOSECONDS)

    def _text(self, code: int) -> str:
        if code >= Fault.RESTARTED:
            return TEXTS[Fault(code)]
        return self._fault_text(code)


def _limits(servo: PlannedServo) -> AxisLimits:
    """Return the ends of the calibrated range, at which the servo clips its goals."""
    ends = sorted(servo.scale.angle(end) for end in servo.range_ticks)
    return AxisLimits(ends[0], ends[1], np.inf, np.inf)
