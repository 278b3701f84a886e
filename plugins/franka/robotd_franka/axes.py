"""Axes: one switch, one alarm, and joint targets; moves and stops are made by ``ProfiledAxes``.

On means that the impedance controller of this computer follows targets. Off means that the arm
holds itself: its brakes are closed in Desk only.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robotd.api import (
    AxisLimits,
    DeviceContext,
    FloatArray,
    NotReady,
    Operation,
    OperationError,
    ProcessImage,
    ProfiledAxes,
    Unsupported,
)
from robotd_franka.arm_link import NO_VELOCITY, ArmLink
from robotd_franka.code_tables import GUIDING, RECOVERY, REFLEX, alarm_of
from robotd_franka.device import FrankaDevice
from robotd_franka.limits import ARM_LIMITS
from robotd_franka.options import JOINTS, FrankaOptions

STOP_DECELERATION = 4.0  # rad/s²
QUICK_STOP_DECELERATION = 10.0  # FCI's acceleration limit of the FR3
REST_RAD_S = 0.02  # below it a guided joint is held


class FrankaAxes(ProfiledAxes):
    """The seven joints of the arm."""

    def __init__(self, device: FrankaDevice, context: DeviceContext[FrankaOptions]) -> None:
        self._target_period_s = 1.0 / context.robot.cycle.rate_hz
        super().__init__(
            JOINTS,
            self._target_period_s,
            context.clock,
            STOP_DECELERATION,
            QUICK_STOP_DECELERATION,
            feedback_lost_s=context.robot.engine.stale_after_s,
        )
        self._device, self._options = device, context.options
        self._last_target: FloatArray | None = None
        self._starts = 0  # of the impedance controller, seen by a period
        self._let_go: frozenset[int] = frozenset()  # axes without stiffness
        self._caught: frozenset[int] = frozenset()  # of them, those that are braked

    @property
    def servo_groups(self) -> Sequence[Sequence[int]]:
        return (range(JOINTS),)

    @property
    def device_limits(self) -> Sequence[AxisLimits]:
        return ARM_LIMITS[self._options.model]

    def read(self, image: ProcessImage) -> None:
        super().read(image)
        link = self._device.live
        if link is not None and link.state is not None and link.state.mode == GUIDING:
            image.operation[:] = Operation.GUIDING  # by the buttons at the flange

    def read_feedback(self, image: ProcessImage) -> None:
        link = self._device.live
        state = link.state if link is not None else None
        if link is None or state is None:
            return
        image.fresh_ns = state.time_ns
        image.position[:] = state.position
        image.velocity[:] = state.velocity
        image.torque[:] = state.torque
        # A change of the payload ends and starts the controller, maybe between two periods: one
        # period shows it off, so that the command begins where the arm is.
        followed = state.followed and link.starts == self._starts
        self._starts = link.starts
        image.servo_on[:] = followed
        image.offline[:] = False
        image.silent[:] = followed and link.silent
        if image.silent.any() and self._last_target is not None:
            image.position_command[:] = self._last_target  # followed with the next state
        image.set_controller_alarm(*alarm_of(state.mode, state.errors))
        image.reason[:] = [link.ended] * JOINTS
        if not followed:
            self._last_target, self._let_go = None, frozenset()

    def send_targets(self, positions: FloatArray) -> None:
        link = self._device.live
        if link is None or not np.isfinite(positions).all():
            return
        target, last = positions.copy(), self._last_target
        self._last_target = target
        velocity = NO_VELOCITY if last is None else (target - last) / self._target_period_s
        if self._let_go and last is not None:  # their damping brakes them
            velocity[list(self._let_go)] = 0.0
        link.set_target(target, velocity)

    def servo(self, axis: int, on: bool, timeout_s: float) -> None:
        with self._device.switching:
            link = self._connected()
            if on and link.state is not None and link.state.followed:
                return
            if not on:
                self._device.end_following(timeout_s)
                return
            self._device.follow(timeout_s)

    def confirmed_off(self) -> Sequence[bool] | None:
        try:
            state = self._device.link.state
        except NotReady:
            return None
        return [state is not None and not state.followed] * JOINTS

    def clear_alarm(self, axis: int, timeout_s: float) -> None:
        with self._device.switching:
            link = self._connected()
            state = link.state
            code, text = alarm_of(state.mode, state.errors) if state is not None else (0, "")
            if state is None or not code:
                return
            if state.mode == REFLEX:
                link.recover()
            elif state.mode != RECOVERY:
                raise OperationError(text)
            self._device.wait_for(
                lambda state: not alarm_of(state.mode)[0], timeout_s, "the end of the reflex"
            )

    def let_go(self, axes: Sequence[int], timeout_s: float) -> None:
        if len({*axes}) < JOINTS:
            raise Unsupported("hand guiding of single joints: they are switched together")
        with self._device.switching:
            link = self._connected()
            with self._lock:  # which ``catch`` and ``is_let_go`` are called with
                self._let_go, self._caught = self._let_go | {*axes}, self._caught - {*axes}
                link.soften(sorted(self._let_go))

    def catch(self, axes: Sequence[int]) -> None:
        self._caught |= {*axes}
        link = self._device.live
        if link is not None:  # the target is the position until the joint rests
            link.soften(sorted(self._let_go - self._caught))

    def is_let_go(self, axis: int) -> bool:
        link = self._device.live
        if link is None or link.state is None or axis not in self._let_go:
            return False
        if axis in self._caught and abs(link.state.velocity[axis]) < REST_RAD_S:
            self._let_go, self._caught = self._let_go - {axis}, self._caught - {axis}
        return axis in self._let_go

    def _connected(self) -> ArmLink:
        if not self._device.communicating:
            raise NotReady("the arm does not communicate")
        return self._device.link
