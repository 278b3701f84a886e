"""Process image of the simulation."""

from __future__ import annotations

from struct import Struct

import numpy as np

from robotd.api import CommandMode, ProcessImage
from robotd_sim.simulation import Simulation


class Readout:
    """Fills process images. Hold the world's lock.

    Axes that do not answer keep their last values, as a receive buffer does. An image that shows
    what there is already costs a comparison: mostly the drives' states, at rest all of it.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        axes, options = simulation.axes, simulation.options
        self._image: ProcessImage | None = None  # the one that was filled last
        self._values = memoryview(b"")  # of its values; NumPy makes one slowly
        self._fresh_ns = 0  # its own, then
        self._states: object = None  # what it shows, see ``snapshot``
        self._motion: object = None
        self._fresh = ProcessImage(axes)  # values as they are received
        self._fresh_values = self._fresh.values.data
        self._velocity_noise, self._torque_noise = (
            options.velocity_noise_rad_s,
            options.torque_noise_nm,
        )
        self._noisy = bool(self._velocity_noise or self._torque_noise)
        if self._noisy:  # numpy.random is imported with the first use of it
            self._random = np.random.default_rng(options.seed)
        self._pack = Struct(f"{5 * axes}d").pack_into
        self._followers: list[int] = []  # axes whose position command is what they measure

    def fill(self, image: ProcessImage) -> None:
        simulation = self._simulation
        if simulation.network.frozen:
            return
        if image is not self._image or image.fresh_ns != self._fresh_ns:
            self._image, self._states, self._motion = image, None, None
            self._values = image.values.data
        communicating = simulation.communicating
        states = (communicating, simulation.switches.changes, simulation.states.snapshot())
        if states != self._states:
            self._states, self._motion = states, None
            self._show_states(image)
        if communicating:
            image.fresh_ns = simulation.world.now_ns
            motion = simulation.servo.snapshot()
            if motion != self._motion or self._noisy:
                self._motion = motion
                self._show_motion(image)
        self._fresh_ns = image.fresh_ns

    def _show_states(self, image: ProcessImage) -> None:
        states = self._simulation.states
        image.servo_on[:] = states.servo_on
        image.amp_alarm[:] = states.amp_alarm
        image.alarm_code[:] = states.alarm_code
        image.home_done[:] = states.home_done
        image.motion_complete[:] = states.motion_complete
        image.mode[:] = states.mode_feedback
        image.operation[:] = states.operation
        image.reason[:] = states.reason
        # In one step: no other thread may see a drive offline that is not.
        if self._simulation.communicating:
            np.logical_not(states.connected, image.offline)
        else:
            image.offline[:] = True
        # Without a position loop the engine lets the commanded position follow the measured one.
        follows = (states.mode_feedback != CommandMode.POSITION) | ~states.servo_on
        self._followers = np.flatnonzero(follows).tolist()

    def _show_motion(self, image: ProcessImage) -> None:
        if self._simulation.all_connected:
            self._receive(image, self._values)
        else:
            self._receive(self._fresh, self._fresh_values)
            self._keep_offline(image)

    def _receive(self, image: ProcessImage, values: memoryview) -> None:
        """Write the measured and commanded values of all axes into ``image``, by its ``values``."""
        servo = self._simulation.servo
        state = servo.state()
        positions, commands, speeds, _ = state
        velocities, torques = servo.measure(state)
        positions = self._simulation.scaling.quantised(positions)
        for axis in self._followers:
            commands[axis] = positions[axis]
        # In the order of the image's rows. NumPy takes three times as long for lists.
        self._pack(values, 0, *commands, *speeds, *positions, *velocities, *torques)
        if self._torque_noise:
            image.torque += self._torque_noise * self._random.standard_normal(servo.axes)
        if self._velocity_noise:
            image.velocity += self._velocity_noise * self._random.standard_normal(servo.axes)
        switches = self._simulation.switches
        if switches.in_use:
            switches.read("negative_limit", image.position, image.negative_limit)
            switches.read("positive_limit", image.position, image.positive_limit)
            switches.read("home_switch", image.position, image.home_switch)

    def _keep_offline(self, image: ProcessImage) -> None:
        fresh, online = self._fresh, self._simulation.states.connected
        for name in ("position", "velocity", "torque", "position_command", "velocity_command",
                     "negative_limit", "positive_limit", "home_switch"):  # fmt: skip
            np.copyto(getattr(image, name), getattr(fresh, name), where=online)
