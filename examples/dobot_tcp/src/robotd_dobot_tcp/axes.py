"""Axes: one switch, one alarm, and joint targets; moves and stops are made by ``ProfiledAxes``."""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence

import numpy as np

from robotd.api import (
    AxisLimits,
    ConnectionState,
    DeviceContext,
    FloatArray,
    NotReady,
    ProcessImage,
    ProfiledAxes,
)
from robotd_dobot_tcp.alarms import alarm_text
from robotd_dobot_tcp.device import DobotDevice
from robotd_dobot_tcp.link import Link
from robotd_dobot_tcp.options import JOINTS, DobotOptions
from robotd_dobot_tcp.protocol import FEEDBACK_PERIOD_S


class DobotAxes(ProfiledAxes):
    """The six joints of the arm."""

    def __init__(self, device: DobotDevice, context: DeviceContext[DobotOptions]) -> None:
        period_s = 1.0 / context.robot.cycle.rate_hz
        lost_s = context.robot.engine.stale_after_s
        super().__init__(JOINTS, period_s, context.clock, feedback_lost_s=lost_s)
        self._device, self._options = device, context.options
        self._periods = max(1, round(context.options.target_period_s / period_s))
        self._period = 0
        self._switching = threading.Lock()  # each command sees the effect of the one before

    @property
    def servo_groups(self) -> Sequence[Sequence[int]]:
        return (range(JOINTS),)

    @property
    def feedback_period_s(self) -> float:
        return FEEDBACK_PERIOD_S

    @property
    def device_limits(self) -> Sequence[AxisLimits]:
        velocity = math.radians(self._options.velocity_deg_s)
        ends = [math.radians(end) for end in self._options.ranges_deg]
        return [AxisLimits(-end, end, velocity, math.inf) for end in ends]

    def read_feedback(self, image: ProcessImage) -> None:
        values = self._device.feedback
        if values is None:
            return
        image.fresh_ns = values.time_ns
        image.position[:] = values.position
        image.velocity[:] = values.velocity
        image.servo_on[:] = values.enabled
        image.offline[:] = False
        image.set_controller_alarm(values.alarm, alarm_text(values.alarm))

    def send_targets(self, positions: FloatArray) -> None:
        self._period = (self._period + 1) % self._periods
        if self._period == 0 and self._device.state() is ConnectionState.COMMUNICATING:
            self._device.link.send_target(np.degrees(positions))

    def servo(self, axis: int, on: bool, timeout_s: float) -> None:
        with self._switching:
            link = self._connected()
            if on and link.feedback is not None and link.feedback.enabled:
                return
            link.command("EnableRobot" if on else "DisableRobot")
            what = f"the servos to be {'on' if on else 'off'}"
            self._device.wait_for(lambda values: values.enabled is on, timeout_s, what)

    def clear_alarm(self, axis: int, timeout_s: float) -> None:
        link = self._connected()
        if link.feedback is not None and link.feedback.alarm:
            link.command("ClearError")
            self._device.wait_for(lambda values: not values.alarm, timeout_s, "the alarm to end")

    def _connected(self) -> Link:
        if not self._device.communicating:
            raise NotReady("the controller does not communicate")
        return self._device.link
