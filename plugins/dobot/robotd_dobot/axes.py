"""Axes: one switch, one alarm, and joint targets; moves and stops are made by ``ProfiledAxes``."""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from enum import Enum, auto

import numpy as np

from robotd.api import (
    NANOSECONDS,
    AxisLimits,
    DeviceContext,
    FloatArray,
    NotReady,
    ProcessImage,
    ProfiledAxes,
    Unsupported,
)
from robotd_dobot.code_tables import alarm_text
from robotd_dobot.device import DobotDevice
from robotd_dobot.link import ControllerLink, Feedback
from robotd_dobot.options import DobotOptions
from robotd_dobot.protocol import FEEDBACK_PERIOD_S, JOINTS, Mode

REPEAT_S = 0.5  # in which the last target is repeated; then the controller holds it
RETRY_S = 0.5  # between two requests to end drag mode
KEEPS = (
    "If robotd or its computer ends, the arm stops at its last target and stays on: the emergency"
    " stop switches it off"
)
UNKNOWN_PAYLOAD = (
    "backends.dobot.payload_kg is not set: with a wrong payload in the controller the arm sinks or"
    " rises when it is guided by hand"
)


class Guiding(Enum):
    """State of drag mode as robotd has asked for it."""

    NONE = auto()
    BEGINS = auto()
    ON = auto()
    ENDS = auto()


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
        self._guiding = Guiding.NONE
        self._asked_ns = 0  # when the end of drag mode was asked for
        self._sent: FloatArray = np.full(JOINTS, np.nan)
        self._changed_ns = 0  # time of the first target that was as ``_sent``

    @property
    def servo_groups(self) -> Sequence[Sequence[int]]:
        return (range(JOINTS),)

    @property
    def feedback_period_s(self) -> float:
        return FEEDBACK_PERIOD_S

    @property
    def response_s(self) -> float:
        return self._options.target_period_s

    @property
    def cautions(self) -> Sequence[str]:
        return (KEEPS,) if self._options.payload else (KEEPS, UNKNOWN_PAYLOAD)

    @property
    def device_limits(self) -> Sequence[AxisLimits]:
        velocity = math.radians(self._options.velocity_deg_s)
        ends = [math.radians(end) for end in self._options.ranges_deg]
        return [AxisLimits(-end, end, velocity, math.inf) for end in ends]

    def read_feedback(self, image: ProcessImage) -> None:
        link = self._device.exchanging
        values = link.feedback if link else None
        if link is None or values is None:
            return
        link.watch_targets()
        self._watch_guiding(values, link)
        guided = self._guiding is not Guiding.NONE and values.enabled
        # What something else moves, and what rejects targets, shows servos that are off: its
        # command then follows the arm, and nothing pulls it back afterwards.
        obeys = guided or (values.takes_targets and not link.rejection)
        image.fresh_ns = values.time_ns
        image.position[:] = values.position
        image.velocity[:] = values.velocity
        image.servo_on[:] = obeys
        image.offline[:] = False
        image.set_controller_alarm(values.alarm, alarm_text(values.alarm))
        image.reason[:] = [_reason(values, link, obeys=obeys)] * JOINTS

    def send_targets(self, positions: FloatArray) -> None:
        self._period = (self._period + 1) % self._periods
        link = self._device.exchanging
        if self._period or link is None or self._guiding is not Guiding.NONE:
            return
        now_ns = self.clock.now_ns()
        if not np.array_equal(positions, self._sent):
            self._sent, self._changed_ns = positions.copy(), now_ns
        if now_ns - self._changed_ns <= REPEAT_S * NANOSECONDS:
            link.send_target(np.degrees(positions))

    def let_go(self, axes: Sequence[int], timeout_s: float) -> None:
        if len(axes) < JOINTS:
            raise Unsupported("hand guiding of single joints: the controller lets go all of them")
        with self._switching:
            link = self._connected()
            self._guiding = Guiding.BEGINS  # ends the stream of targets
            try:
                idle = "the controller to be idle"
                self._device.wait_for(lambda values: values.mode == Mode.ENABLED, timeout_s, idle)
                link.command("StartDrag")
                self._device.wait_for(lambda values: values.dragged, timeout_s, "drag mode")
            except BaseException:
                self._guiding = Guiding.ENDS
                raise
            self._guiding = Guiding.ON

    def catch(self, axes: Sequence[int]) -> None:
        self._guiding = Guiding.ENDS  # the next period asks for it, and again until it has ended

    def is_let_go(self, axis: int) -> bool:
        return self._guiding is not Guiding.NONE

    def servo(self, axis: int, on: bool, timeout_s: float) -> None:
        with self._switching:
            if on:
                self._switch_on(self._connected(), timeout_s)
            else:
                self._device.switch_off(timeout_s)

    def clear_alarm(self, axis: int, timeout_s: float) -> None:
        link = self._connected()
        if link.feedback is not None and link.feedback.alarm:
            link.command("ClearError")
            self._device.wait_for(lambda values: not values.alarm, timeout_s, "the alarm to end")

    def _switch_on(self, link: ControllerLink, timeout_s: float) -> None:
        if self._guiding is not Guiding.NONE:
            raise NotReady("the arm is guided by hand")
        wait_for, values = self._device.wait_for, link.feedback
        if values is not None and values.mode == Mode.POWER_OFF:
            link.command("PowerOn")
            powered = "the arm to have power, which takes 10 s: switch it on again"
            wait_for(lambda values: values.mode != Mode.POWER_OFF, timeout_s, powered)
        if values is not None and values.enabled and values.dragged:
            link.command("StopDrag")
            released = "the end of drag mode: let go of the drag button"
            wait_for(lambda values: not values.dragged, timeout_s, released)
        elif values is None or not values.enabled:
            link.command("EnableRobot", *self._device.payload_to_enable, timeout_s=timeout_s)
        link.forget_rejection()
        wait_for(lambda values: values.enabled, timeout_s, "the servos to be on")
        self._device.select_frames(timeout_s)
        if reason := _reason(link.feedback, link, obeys=False):
            raise NotReady(reason)

    def _watch_guiding(self, values: Feedback, link: ControllerLink) -> None:
        """Follow drag mode to its end, and ask for that again where it does not come."""
        if self._guiding in (Guiding.NONE, Guiding.BEGINS):
            return
        if not values.dragged or not values.enabled:
            self._guiding = Guiding.NONE
        elif self._guiding is Guiding.ENDS:
            now_ns = self.clock.now_ns()
            if now_ns - self._asked_ns > RETRY_S * NANOSECONDS:
                self._asked_ns = now_ns
                link.post("StopDrag")

    def _connected(self) -> ControllerLink:
        if not self._device.communicating:
            raise NotReady("the controller does not communicate")
        return self._device.link


def _reason(values: Feedback | None, link: ControllerLink, *, obeys: bool) -> str:
    """Return why the arm takes no targets; "" where it does, or is plainly off."""
    if values is None or obeys or values.alarm or values.mode in (Mode.DISABLED, Mode.ALARM):
        return ""
    return link.rejection if values.takes_targets else link.dialect.mode_text(values.mode)
