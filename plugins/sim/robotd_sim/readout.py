"""What the process image shows of the simulation."""

from __future__ import annotations

import numpy as np

from robotd.plugin.api import CommandMode, ProcessImage
from robotd_sim.simulation import Simulation


class Readout:
    """Fills process images; allocates nothing per axis. Hold the world's lock.

    Axes that do not answer keep their last values, as a receive buffer does.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        axes, options = simulation.axes, simulation.options
        self._fresh = ProcessImage(axes)  # values as they are received
        self._online = np.zeros(axes, bool)
        self._follows = np.zeros(axes, bool)
        self._random = np.random.default_rng(options.seed)
        self._velocity_noise, self._torque_noise = (
            options.velocity_noise_rad_s,
            options.torque_noise_nm,
        )
        lows, highs = np.full(axes, np.inf), np.full(axes, -np.inf)
        for axis, switch in options.home_switches.items():
            lows[axis] = switch.position_rad - switch.width_rad / 2
            highs[axis] = switch.position_rad + switch.width_rad / 2
        self._home_low, self._home_high = lows, highs
        self._switches = bool(options.home_switches) or simulation.guards.has_switches

    def fill(self, image: ProcessImage) -> None:
        simulation, states = self._simulation, self._simulation.states
        if simulation.network.frozen:
            return
        if simulation.communicating:
            image.fresh_ns = simulation.world.now_ns
            np.logical_not(states.connected, image.offline)
            if simulation.all_connected:
                self._receive(image)
            else:
                self._receive(self._fresh)
                self._keep_offline(image)
        else:
            image.offline[:] = True
        image.servo_on[:] = states.servo_on
        image.amp_alarm[:] = states.amp_alarm
        image.alarm_code[:] = states.alarm_code
        image.home_done[:] = states.home_done
        image.motion_complete[:] = states.motion_complete
        image.mode[:] = states.mode_feedback
        image.operation[:] = states.operation
        image.reason[:] = states.reason

    def _receive(self, image: ProcessImage) -> None:
        """The measured and commanded values of all axes into ``image``."""
        servo, states, follows = self._simulation.servo, self._simulation.states, self._follows
        self._simulation.scaling.quantise(servo.position, image.position)
        servo.measure_velocity(image.velocity)
        servo.measure_torque(image.velocity, image.torque)
        if self._torque_noise:
            image.torque += self._torque_noise * self._random.standard_normal(servo.axes)
        if self._velocity_noise:
            image.velocity += self._velocity_noise * self._random.standard_normal(servo.axes)
        image.position_command[:] = servo.command
        image.velocity_command[:] = servo.command_velocity
        # Without a position loop the engine lets the commanded position follow the measured one.
        np.not_equal(states.mode_feedback, CommandMode.POSITION, follows)
        np.copyto(image.position_command, image.position, where=follows)
        np.logical_not(states.servo_on, follows)
        np.copyto(image.position_command, image.position, where=follows)
        if self._switches:
            self._read_switches(image)

    def _read_switches(self, image: ProcessImage) -> None:
        guards, position = self._simulation.guards, image.position
        np.less_equal(position, guards.negative_switch, image.negative_limit)
        np.greater_equal(position, guards.positive_switch, image.positive_limit)
        np.greater_equal(position, self._home_low, image.home_switch)
        image.home_switch &= position <= self._home_high

    def _keep_offline(self, image: ProcessImage) -> None:
        fresh, online = self._fresh, self._simulation.states.connected
        for name in ("position", "velocity", "torque", "position_command", "velocity_command",
                     "negative_limit", "positive_limit", "home_switch"):  # fmt: skip
            np.copyto(getattr(image, name), getattr(fresh, name), where=online)
