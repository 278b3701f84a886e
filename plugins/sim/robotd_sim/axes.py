"""The axis driver: checks in the engine's order, commands, and the reading of all axes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from struct import Struct

import numpy as np

from robotd.api import (
    AxisDriver,
    CommandMode,
    DeviceTimeout,
    FloatArray,
    NotReady,
    Operation,
    OperationError,
    ProcessImage,
    Profile,
    Unsupported,
    wait_until,
)
from robotd_sim.simulation import Simulation

_OVERRIDABLE = (Operation.IDLE, Operation.POSITION, Operation.VELOCITY)
MODE_TICKS = 2  # until a drive is in the requested mode
_MODE_TIMEOUT_S = 1.0


class SimAxes(AxisDriver):
    """All axes of one simulation."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation, self._world = simulation, simulation.world
        self._states, self._motion = simulation.states, simulation.motion
        self._readout = Readout(simulation)

    def read(self, image: ProcessImage) -> None:
        with self._world.lock:
            self._world.advance()
            self._motion.note_read()
            self._readout.fill(image)

    def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
        with self._world.lock:
            self._world.advance()
            self._motion.stream.setpoint(position, velocity, due_ns)

    def begin_stream(self, axes: Sequence[int]) -> None:
        with self._world.lock:
            self._world.advance()
            for axis in axes:
                by_velocity = self._states.mode[axis] == CommandMode.VELOCITY
                mode = CommandMode.VELOCITY if by_velocity else CommandMode.POSITION
                self._require_free(axis, mode, streaming=True)
            for axis in axes:
                self._motion.begin_stream(axis)

    def end_stream(self, axes: Sequence[int]) -> None:
        with self._world.lock:
            self._world.advance()
            for axis in axes:
                self._motion.end_stream(axis)

    def servo(self, axis: int, on: bool, timeout_s: float) -> None:
        states = self._states
        with self._world.lock:
            self._world.advance()
            if on:
                self._require_drive(axis)
            self._simulation.power.request(axis, on=on)
        if not self._wait(lambda: bool(states.servo_on[axis]) == on, timeout_s):
            wanted = "on" if on else "off"
            raise DeviceTimeout(f"the servo did not go {wanted} within {timeout_s:g} s", axis=axis)

    def clear_alarm(self, axis: int, timeout_s: float) -> None:
        states = self._states
        with self._world.lock:
            self._world.advance()
            self._require_online(axis)
            self._simulation.power.clear(axis)
        if not self._wait(lambda: not (states.amp_alarm[axis] or states.reason[axis]), timeout_s):
            raise DeviceTimeout(f"the alarm is still there after {timeout_s:g} s", axis=axis)

    def set_command_mode(self, axis: int, mode: CommandMode) -> None:
        if mode is CommandMode.TORQUE:
            raise Unsupported("torque mode")
        states = self._states
        with self._world.lock:
            self._world.advance()
            if self._simulation.communicating:
                self._simulation.require_rest(axis, "its mode cannot be changed")
            states.mode[axis] = mode
            self._world.at(self._world.tick + MODE_TICKS, lambda: self._enter_mode(axis))
        if not self._wait(lambda: bool(states.mode_feedback[axis] == mode), _MODE_TIMEOUT_S):
            raise DeviceTimeout(f"not in mode {mode.name.lower()} after 1 s", axis=axis)

    def set_polarity(self, axis: int, polarity: int) -> None:
        self._scale(axis, {"AxisPolarity": polarity})

    def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
        self._scale(
            axis, {"AxisGearRatioNumerator": numerator, "AxisGearRatioDenominator": denominator}
        )

    def home(self, axis: int, timeout_s: float) -> None:
        states = self._states
        with self._world.lock:
            self._world.advance()
            self._require_online(axis)
            self._simulation.require_rest(axis, "it cannot be homed")
            states.home_done[axis] = False
            states.operation[axis] = Operation.HOMING
            self._world.at(self._world.tick + 1, lambda: self._home(axis))
        if not self._wait(lambda: states.operation[axis] != Operation.HOMING, timeout_s):
            raise DeviceTimeout(f"homing did not end within {timeout_s:g} s", axis=axis)
        if not states.home_done[axis]:
            raise OperationError("homing was interrupted", axis=axis)

    def move(self, axis: int, target: float, profile: Profile) -> None:
        with self._world.lock:
            self._world.advance()
            self._require_free(axis, CommandMode.POSITION)
            self._require_free_direction(axis, target - float(self._simulation.servo.command[axis]))
            self._motion.move(axis, target, profile)

    def jog(self, axis: int, profile: Profile) -> None:
        with self._world.lock:
            self._world.advance()
            self._require_free(axis)
            self._require_free_direction(axis, profile.velocity)
            self._motion.jog(axis, profile)

    def begin_guiding(self, axes: Sequence[int], timeout_s: float) -> None:
        with self._world.lock:
            self._world.advance()
            for axis in axes:
                self._require_free(axis, CommandMode.POSITION)
                self._simulation.require_rest(axis, "it cannot be guided by hand")
            for axis in axes:
                self._motion.guide(axis, float(self._simulation.servo.position[axis]))

    def stop(self, axes: Sequence[int]) -> None:
        self._each(axes, self._motion.stop)

    def quick_stop(self, axes: Sequence[int]) -> None:
        self._each(axes, self._motion.quick_stop)

    def _each(self, axes: Sequence[int], command: Callable[[int], None]) -> None:
        with self._world.lock:
            self._world.advance()
            for axis in axes:
                command(axis)

    def _wait(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        def now() -> bool:
            with self._world.lock:
                self._world.advance()
                return condition()

        return wait_until(now, timeout_s, self._simulation.clock)

    def _scale(self, axis: int, changes: dict[str, float]) -> None:
        with self._world.lock:
            self._world.advance()
            if self._states.servo_on[axis]:
                raise NotReady("its scale cannot be changed while the servo is on", axis=axis)
            self._simulation.change_scale(axis, changes)

    def _enter_mode(self, axis: int) -> None:
        self._states.mode_feedback[axis] = self._states.mode[axis]

    def _home(self, axis: int) -> None:
        if self._states.operation[axis] == Operation.HOMING:
            self._states.operation[axis] = Operation.IDLE
            if self._simulation.communicating and self._states.connected[axis]:
                self._simulation.home(axis)

    def _require_online(self, axis: int) -> None:
        if not self._simulation.communicating:
            raise NotReady("the engine is not communicating", axis=axis)
        if not self._states.connected[axis]:
            raise NotReady("the drive is offline", axis=axis)

    def _require_drive(self, axis: int) -> None:
        self._require_online(axis)
        if self._states.amp_alarm[axis]:
            code = self._states.alarm_code[axis]
            raise NotReady(f"the drive is in alarm {code} (0x{code:X})", axis=axis)

    def _require_free(
        self, axis: int, mode: CommandMode | None = None, *, streaming: bool = False
    ) -> None:
        """``axis`` takes commands of ``mode`` now; None: in any mode."""
        self._require_drive(axis)
        if not self._states.servo_on[axis]:
            raise NotReady("the servo is off", axis=axis)
        if mode is not None and self._states.mode[axis] != mode:
            present = CommandMode(int(self._states.mode[axis])).name.lower()
            raise NotReady(f"in {present} mode, not in {mode.name.lower()} mode", axis=axis)
        operation = Operation(int(self._states.operation[axis]))
        if operation not in _OVERRIDABLE and not (streaming and operation is Operation.STREAM):
            raise NotReady(f"takes no command while it is {operation.name.lower()}", axis=axis)

    def _require_free_direction(self, axis: int, direction: float) -> None:
        reason = self._simulation.guards.blocked(axis, float(np.sign(direction)))
        if direction and reason:
            raise OperationError(f"{reason}", axis=axis)


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
        if simulation.network.is_silent(simulation.world.tick):
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
        follows = (
            (states.mode_feedback != CommandMode.POSITION)
            | ~states.servo_on
            | (states.operation == Operation.GUIDING)
        )
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
