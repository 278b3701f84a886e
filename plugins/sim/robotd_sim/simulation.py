"""One simulated robot: its parts, and what parameters and engine states do to them.

world (time) ── servo (dynamics) ← motion (commands) ← power (on, off, alarms)
                                          ↑ guards (limits)
scaling (counts)   states (flags)   image (I/O)   network (slaves)
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from robotd.api import (
    Clock,
    ConnectionState,
    DescriptorError,
    FloatArray,
    NotReady,
    Operation,
    Payload,
    RobotDescriptor,
)
from robotd_servo_model import Mechanics, Servo, ServoWorld
from robotd_sim.axis_states import AxisStates, AxisSwitches
from robotd_sim.limit_guards import Guards
from robotd_sim.motion import Motion
from robotd_sim.network import Network
from robotd_sim.options import IMAGE_BYTES, SimOptions
from robotd_sim.power import Power
from robotd_sim.scaling import Scaling, gains, wrap32
from robotd_wmx_parameters import (
    WmxParameters,
    default_wmx_parameters,
    read_wmx_parameters,
    require_same_scaling,
)


class IoImage:
    """The two images. Hold the world's lock. With ``loopback`` outputs are wired to inputs."""

    def __init__(self, world: ServoWorld, *, initial_inputs: bytes, loopback: bool) -> None:
        self._initial_inputs = initial_inputs.ljust(IMAGE_BYTES, b"\0")
        self.inputs, self.outputs = bytearray(self._initial_inputs), bytearray(IMAGE_BYTES)
        self._world, self._loopback = world, loopback
        self._stuck: dict[tuple[int, int], bool] = {}

    def stick(self, byte: int, bit: int, value: bool | None) -> None:
        """One output bit keeps ``value`` whatever is written; None: normal again."""
        if value is None:
            self._stuck.pop((byte, bit), None)
        else:
            self._stuck[byte, bit] = value
            self._keep_stuck()

    def write(self, byte: int, data: bytes) -> None:
        self.outputs[byte : byte + len(data)] = data
        self._keep_stuck()
        if self._loopback:
            copy = bytes(self.outputs[byte : byte + len(data)])
            self._world.at(self._world.tick + 1, lambda: self._arrive(byte, copy))

    def clear(self) -> None:
        """Both images as at power-on, at the end of the engine."""
        self.inputs[:], self.outputs[:] = self._initial_inputs, bytes(IMAGE_BYTES)
        self._keep_stuck()

    def _keep_stuck(self) -> None:
        for (byte, bit), value in self._stuck.items():
            self.outputs[byte] = self.outputs[byte] & ~(1 << bit) | int(value) << bit

    def _arrive(self, byte: int, data: bytes) -> None:
        self.inputs[byte : byte + len(data)] = data


class Simulation:
    """Everything behind the drivers; ``world.lock`` guards all of it.

    Raises DescriptorError when an option does not fit the robot.
    """

    def __init__(self, robot: RobotDescriptor, options: SimOptions, clock: Clock) -> None:
        self.robot, self.options, self.clock, self.axes = robot, options, clock, robot.axes
        _check_axes(options, self.axes)
        mechanics = Mechanics(
            *(
                options.per_axis(key, self.axes)
                for key in ("bandwidth_hz", "feedforward", "inertia_kg_m2",
                            "viscous_friction_nm_s", "coulomb_friction_nm")
            )
        )  # fmt: skip
        self.servo = Servo(mechanics, options.tick_s)
        self.world = ServoWorld(clock, self.servo, options.max_catch_up_s)
        self.states = AxisStates(self.axes)
        self.engine = ConnectionState.IDLE
        self.failures_left = options.fail_open
        self.lost_because = ""  # what ended the connection, until it is made again
        self.payload = Payload(0.0)
        self.all_connected = True
        self._starts = 0  # number of the present request for communication
        self._defaults = self.parameters = self._engine_defaults()
        self.scaling = Scaling(gains(self.parameters, self.axes))
        self.motion = Motion(
            self.world,
            self.states,
            np.array(robot.stop_decelerations, np.float64),  # None becomes NaN
            1.0 / robot.cycle.rate_hz,
            options.ticks(options.stream_timeout_s),
        )
        coasting = options.per_axis("coast_deceleration_rad_s2", self.axes)
        self.power = Power(self.world, self.states, self.motion, self.scaling, coasting)
        self.switches = AxisSwitches(self.axes, options)
        self.guards = Guards(self.world, self.states, self.motion, self.power, self.switches)
        self.io = IoImage(
            self.world,
            initial_inputs=bytes(options.initial_inputs),
            loopback=options.io_loopback,
        )
        self.network = Network(robot, options)
        self._initial = _initial_positions(robot, options)
        self._configure()
        self._put_joints()

    @property
    def communicating(self) -> bool:
        return self.engine is ConnectionState.COMMUNICATING

    def load(self, parameters: WmxParameters) -> None:
        """Take a whole set of parameters.

        Raises NotReady, naming the axis, while one moves, and where it would change the scale of
        one whose servo is on.
        """
        for axis in range(self.axes):
            self.require_rest(axis, "parameters cannot be loaded")
        states = self.states
        in_force = (
            dict(self.parameters.columns)
            | {
                "AxisCommandMode": states.mode,
                "AbsoluteEncoderHomeOffset": np.where(  # homing has changed it since
                    self._absolute(self.parameters),
                    self.scaling.home,
                    self.parameters["AbsoluteEncoderHomeOffset"][: self.axes],
                ),
            }
        )
        enabled = np.flatnonzero(states.servo_on | states.servo_wanted)
        require_same_scaling(in_force, parameters.columns, enabled.tolist())
        self.apply(parameters)

    def apply(self, parameters: WmxParameters) -> None:
        """Take a whole set of parameters, while the axes are at rest."""
        was, now = self._absolute(self.parameters), self._absolute(parameters)
        origin, home = self.scaling.origin.copy(), self.scaling.home.copy()
        counts = self.scaling.counts(self.servo.position)
        origin[now & ~was] = (counts - wrap32(counts))[now & ~was]
        offset = np.rint(parameters["AbsoluteEncoderHomeOffset"][: self.axes])
        home = np.where(now, offset, home)
        self.parameters = parameters
        self._rescale(origin, home)
        self.states.mode[:] = self.states.mode_feedback[:] = parameters["AxisCommandMode"][
            : self.axes
        ]
        self._configure()

    def require_rest(self, axis: int, what: str) -> None:
        """Raise NotReady unless ``axis`` is idle and at rest."""
        if not self.motion.is_idle(axis):
            doing = Operation(int(self.states.operation[axis])).name.lower()
            doing = "coasting" if doing == "idle" else doing
            raise NotReady(f"{what} while it is moving ({doing})", axis=axis)

    def home(self, axis: int) -> None:
        """The present position becomes HomePosition; nothing moves."""
        position = float(self.parameters["HomePosition"][axis])
        home = self.scaling.home.copy()
        counts = self.scaling.counts(self.servo.position)[axis]
        home[axis] = np.rint(
            counts - self.scaling.origin[axis] - position * self.scaling.gain[axis]
        )
        self._rescale(self.scaling.origin, home)
        self.states.home_done[axis] = True
        self.guards.refresh()

    def change_scale(self, axis: int, changes: Mapping[str, float]) -> None:
        """Change scale parameters of one axis, which is at rest and off."""
        self.require_rest(axis, "its scale cannot be changed")
        self.parameters = self.parameters.with_values(
            {name: {axis: value} for name, value in changes.items()}
        )
        self._rescale(self.scaling.origin, self.scaling.home)

    def disconnect(self, slave: int) -> None:
        self.network.slaves[slave].plugged = False
        self._connect(slave, connected=False)

    def reconnect(self) -> None:
        """Every slave whose plug is in answers again."""
        for slave in self.network.slaves:
            if slave.plugged and not slave.connected:
                self._connect(slave.id, connected=True)

    def request_communication(self) -> None:
        """Communication begins after its delay, unless it is stopped before."""
        self._starts += 1
        number = self._starts

        def begin() -> None:
            if number == self._starts and self.engine is ConnectionState.RUNNING:
                self._wake_encoders()
                self.network.up(self.world.tick)
                self.engine = ConnectionState.COMMUNICATING

        self.world.at(
            self.world.tick + self.options.ticks(self.options.communication_delay_s), begin
        )

    def silence(self) -> None:
        """The cyclic exchange ends: drives switch off by themselves."""
        self._starts += 1
        if not self.communicating:
            return
        self.engine = ConnectionState.RUNNING
        cleared = self.parameters["ClearHomeDoneOnCommStop"][: self.axes]
        for axis in range(self.axes):
            self.power.turn_off(axis)
            if cleared[axis] or not self._absolute(self.parameters)[axis]:
                self.power.lose_home(axis)

    def reset(self) -> None:
        """The engine ends: parameters go back to the defaults, I/O is cleared."""
        self.silence()
        self.engine, self.payload = ConnectionState.IDLE, Payload(0.0)
        self.io.clear()
        for axis in range(self.axes):  # at rest: a start that follows at once loads parameters
            self.motion.hold(axis, float(self.servo.command[axis]))
        self.apply(self._defaults)

    def _connect(self, slave: int, *, connected: bool) -> None:
        self.network.slaves[slave].connected = connected
        axis = self.network.slaves[slave].axis
        if axis is not None:
            self.power.connect(axis, connected=connected)
            self.all_connected = bool(self.states.connected.all())

    def _configure(self) -> None:
        for part in (self.motion, self.power, self.guards):
            part.configure(self.parameters)

    def _rescale(self, origin: np.ndarray, home: np.ndarray) -> None:
        gain = gains(self.parameters, self.axes)
        self.servo.relabel(*self.scaling.change(gain, origin, home))

    def _wake_encoders(self) -> None:
        """Read encoders at power-on: 32 bits of an absolute one.

        An incremental one knows nothing and begins at the initial position, wherever the axis is.
        """
        absolute = self._absolute(self.parameters)
        counts = self.scaling.counts(self.servo.position)
        initial = np.rint(self._initial * self.scaling.gain)
        origin = np.where(absolute, counts - wrap32(counts), counts - initial)
        self._rescale(origin, np.where(absolute, self.scaling.home, 0.0))
        for axis in range(self.axes):  # what still coasts has been planned in the old numbers
            self.power.coast(axis)

    def _absolute(self, parameters: WmxParameters) -> np.ndarray:
        return parameters["AbsoluteEncoderMode"][: self.axes]

    def _engine_defaults(self) -> WmxParameters:
        """Return the defaults of the vendor, except that a unit is a radian."""
        axes = range(self.axes)
        counts = float(self.options.encoder_counts_per_turn)
        return default_wmx_parameters().with_values({
            "AxisGearRatioNumerator": dict.fromkeys(axes, counts),
            "AxisGearRatioDenominator": dict.fromkeys(axes, 2 * math.pi),
        })  # fmt: skip

    def _put_joints(self) -> None:
        """Put the joints where absolute encoders will read the initial position."""
        parameters, robot = self.parameters, self.robot
        if robot.parameters_file is not None and robot.path is not None:
            parameters = read_wmx_parameters(robot.path.parent / robot.parameters_file)
        offset = parameters["AbsoluteEncoderHomeOffset"][: self.axes]
        counts = self._initial * gains(parameters, self.axes) + offset
        for axis, position in enumerate(counts / self.scaling.gain):
            self.servo.place(axis, float(position), float(position), 0.0)
            self.motion.hold(axis, float(position))


def _initial_positions(robot: RobotDescriptor, options: SimOptions) -> FloatArray:
    """Return the option, or the descriptor's position of each joint and 0 of other axes."""
    if options.initial_position_rad is not None:
        return options.per_axis("initial_position_rad", robot.axes)
    initial = np.zeros(robot.axes)
    for joint in robot.joints:
        initial[joint.axis] = joint.initial_position
    return initial


def _check_axes(options: SimOptions, axes: int) -> None:
    for key in ("limit_switches", "home_switches"):
        for axis in getattr(options, key):
            if not 0 <= axis < axes:
                message = f"axis {axis} does not exist, the robot has {axes} axes"
                raise DescriptorError(message, key=f"backends.sim.{key}")
