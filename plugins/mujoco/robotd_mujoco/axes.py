"""The axis driver: profiles of the core, drives of the physics."""

from __future__ import annotations

import numpy as np

from robotd.api import DeviceContext, FloatArray, NotReady, ProcessImage, ProfiledAxes
from robotd_mujoco.options import MujocoOptions
from robotd_mujoco.physics import Physics


class MujocoAxes(ProfiledAxes):
    """All axes of one robot."""

    def __init__(self, physics: Physics, context: DeviceContext[MujocoOptions]) -> None:
        super().__init__(physics.axes, 1.0 / context.robot.cycle.rate_hz, context.clock)
        self._physics = physics
        options = context.options
        self._noise = options.torque_noise_nm, options.velocity_noise_rad_s
        self._random = np.random.default_rng(options.seed)

    def read_feedback(self, image: ProcessImage) -> None:
        physics = self._physics
        with physics.lock:
            physics.advance()
            if physics.frozen:
                return
            image.servo_on[:] = physics.servo_on
            image.alarm_code[:] = physics.alarm_code
            image.amp_alarm[:] = physics.alarm_code != 0
            image.offline[:] = ~physics.connected if physics.talking else True
            image.reason[:] = physics.reason
            image.home_done[:] = True  # absolute encoders
            if not physics.talking:
                return
            image.fresh_ns = physics.now_ns
            online = physics.connected
            np.copyto(image.position, physics.positions() + physics.encoder_offset, where=online)
            np.copyto(image.velocity, physics.velocities(), where=online)
            np.copyto(image.torque, physics.torques(), where=online)
        torque, velocity = self._noise
        if torque:
            image.torque += torque * self._random.standard_normal(physics.axes)
        if velocity:
            image.velocity += velocity * self._random.standard_normal(physics.axes)

    def send_targets(self, positions: FloatArray) -> None:
        with self._physics.lock:
            if self._physics.talking:
                self._physics.follow(positions)

    def servo(self, axis: int, on: bool, timeout_s: float) -> None:
        with self._physics.lock:
            self._physics.advance()
            if on:
                self._physics.enable(axis)
            else:
                self._physics.disable(axis)

    def clear_alarm(self, axis: int, timeout_s: float) -> None:
        with self._physics.lock:
            if not self._physics.talking:
                raise NotReady("the drive does not answer", axis=axis)
            self._physics.clear(axis)
