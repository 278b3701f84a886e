"""Contracts of the drivers that a backend provides: device, axes, I/O and fieldbus.

Units are SI at this boundary: rad or m, rad/s or m/s, rad/s² or m/s², N·m or N, seconds. Counts,
gear ratios and polarity stay inside the backend. Axis numbers run from 0 to n_axes - 1, and
arrays have the shape (n_axes,).

The core checks every argument before it calls a driver. A driver may rely on: axis in range,
no axis twice, finite numbers, positive velocities and ramps where a move needs them, targets
within the limits of the joint, the servo on, no alarm, and the command mode that the command needs.
Checks go by the process image, one period old: a driver still rejects what the device rejects.

Threads: the control-loop thread calls ``AxisDriver.read`` and ``AxisDriver.stream``. They must
not block, should not allocate, and must not raise in normal operation. Every other method may be
called by any worker thread at any time, several at once; it may block for at most its ``timeout_s``
(10 s where it has none), and must not delay the control loop: never hold a lock that ``read`` needs
while waiting.

Errors: a driver raises ``InvalidArgument``, ``OperationError``, ``NotReady``, ``Unsupported`` or
``DeviceTimeout`` with the reason alone; in a method that commands one axis the core adds its name.
Any other exception is reported as a fault of the plugin.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Sequence
from pathlib import Path

from robotd.arrays import FloatArray
from robotd.device.bus_status import BusStatus
from robotd.device.capabilities import Capability
from robotd.device.process_image import ProcessImage
from robotd.device.state import CommandMode, ConnectionState, Underrun
from robotd.errors import Unsupported
from robotd.motion.limits import AxisLimits
from robotd.motion.profile import Profile


class DeviceDriver(ABC):
    """Connection to a device: an engine, a controller or a bus."""

    @abstractmethod
    def open(self, path: str = "", name: str = "") -> None:
        """Connect; IDLE → RUNNING. An open device: no effect.

        Args:
            path: device, bus or SDK to open instead of the configured one; empty: configured.
            name: name of this client, for the device; empty: the robot's name.

        Raises:
            ConnectError: names every part that does not answer.
        """

    @abstractmethod
    def close(self) -> None:
        """Disconnect from any state; → IDLE. Called twice: no effect."""

    @abstractmethod
    def start_communication(self, timeout_s: float) -> None:
        """Begin the cyclic exchange; RUNNING → COMMUNICATING. Nothing moves.

        A device that communicates: no effect. Also called to resume after the link was lost, while
        ``state`` is RUNNING or UNKNOWN.
        """

    @abstractmethod
    def stop_communication(self, timeout_s: float) -> None:
        """End the cyclic exchange; → RUNNING. Axes are stopped and servos go off.

        Also called to undo a ``start_communication`` that failed or timed out: what it has asked
        for must not happen later.
        """

    @abstractmethod
    def state(self) -> ConnectionState:
        """Return the state of the device now. Never blocks.

        When the link is lost: UNKNOWN while it may come back by itself, RUNNING once
        ``start_communication`` can resume, IDLE when the device has to be opened again.
        ``fault`` gives the reason.
        """

    def fault(self) -> str:
        """Return why no fresh values arrive, one line; "" if nothing is wrong. Never blocks."""
        return ""

    def scan_network(self) -> str:
        """Return a one-line summary of the devices that answer."""
        return "not scanned: this backend has no scan"

    @property
    def parameters_before_communication(self) -> bool:
        """The descriptor's parameter file is applied before ``start_communication``, not after.

        Where the device allows it, it should: then it never communicates with other parameters.
        """
        return False

    def load_parameters(self, path: Path) -> str:
        """Apply a parameter file, all of it or (on an error) nothing (PARAMETERS_FILE).

        It is in force until the device is closed, or another one is applied. Returns a note for
        the user, such as what the file leaves out; "" for none.

        Raises:
            DescriptorError: the file is wrong, or lacks axes of the robot; all are named.
            NotReady: it would change what a position means (polarity, gear ratio, encoder,
                command mode) of an axis whose servo is on; axis and parameter are named. The
                core switches no servo on meanwhile.
        """
        raise Unsupported("parameter files")

    def dump_parameters(self, axis: int) -> str:
        """Return the parameters of one axis in force, as text (PARAMETERS_FILE).

        With what ``set_polarity`` and ``set_gear_ratio`` have changed since the device was opened.
        """
        raise Unsupported("parameter files")


class AxisDriver(ABC):
    """Axes of one device.

    Methods that name a capability are needed only by a backend that declares it.

    Whatever has ended a motion, only a new command begins one: nothing moves when an alarm is
    cleared, a servo is switched on, a mode is changed, a link is back or communication begins. No
    servo goes on by itself. What is accepted is executed as it was commanded: a device that cannot
    rejects it, or names its limit in ``device_limits``. A command or a fault of one axis leaves the
    motion of others as it is, unless they share its servo switch or the controller's alarm.

    The first setpoint that an axis can get after a silence of its drive is within its limits from
    the last one that the drive has acknowledged. What could not be delivered is not executed later.
    Stops and servo off need no fresh values: a drive gets them as soon as it can, or they raise.
    """

    @property
    def read_only(self) -> str:
        """Reason why the axes take no commands; "": they do. Read once, at start."""
        return ""

    @property
    def underrun(self) -> Underrun:
        """Behaviour of a streaming axis while ``stream`` is not called in time."""
        return Underrun.EXTRAPOLATE

    @property
    def feedback_period_s(self) -> float:
        """Time between two measured values, seconds; 0: new values in each control period.

        With slower feedback ``read`` holds the last values, and ``fresh_ns`` stays theirs. The core
        takes their age into account: a following error is the difference from the command of that
        time, and joint states carry that time.
        """
        return 0.0

    @property
    def response_s(self) -> float:
        """Time from a command to the motion that it asks for, seconds; 0: within a period.

        The core compares a measured value with the command of that much earlier, and waits so long
        before it takes an axis that has just been commanded for one at rest.
        """
        return 0.0

    @property
    def device_limits(self) -> Sequence[AxisLimits]:
        """Limits that the device itself clips or rejects by, one per axis; empty: not known.

        inf for a value without a limit, ``unit`` as of the axis. Read once, before the device is
        opened. Every command is checked against the smaller of these and those of the descriptor.
        """
        return ()

    @property
    def cautions(self) -> Sequence[str]:
        """Dangers of the drives that a person beside them has to know, a text each.

        As far as files tell it before the device is opened, and as the drives have shown it after
        communication has started. Any worker.
        """
        return ()

    @property
    def lacking(self) -> Collection[Capability]:
        """Declared capabilities that this robot does not have; they count as not declared."""
        return ()

    @property
    def max_trajectory_points(self) -> int:
        """Number of points that ``follow`` takes at most (TRAJECTORIES_ON_DEVICE)."""
        return 1000

    @property
    def servo_groups(self) -> Sequence[Sequence[int]]:
        """Groups of axes that share one servo switch; others have their own.

        ``servo`` of one axis then switches its group; the core names all of them to the client.
        """
        return ()

    @property
    def stream_buffer_s(self) -> float:
        """Duration of the position setpoints that the device holds ahead, s; 0: none.

        The command reaches a setpoint so much later than its due time, and a gap between two
        setpoints that is no longer than this (and one and a half periods) is not an underrun.
        """
        return 0.0

    @property
    def follows_trajectories(self) -> bool:
        """Trajectories go to ``follow`` (with capability TRAJECTORIES_ON_DEVICE).

        False: they are streamed after all, for ``stream`` takes positions too.
        """
        return True

    @abstractmethod
    def read(self, image: ProcessImage) -> None:
        """Fill every array of ``image`` in place, and ``fresh_ns``. Control-loop thread.

        ``fresh_ns`` is when the values were taken; of their arrival where a bus does not tell.
        Without new values leave ``fresh_ns`` as it is. Values that are not measured are NaN
        (``torque``, for example). ``shift_ns`` lets the control loop follow a clock of the device.
        """

    @abstractmethod
    def servo(self, axis: int, on: bool, timeout_s: float) -> None:
        """Enable or disable the drive and wait until the drive confirms.

        Before enabling, set the command to the measured position (no jump). Enabling leaves an
        enabled axis as it is, also in motion; disabling works in every state, also after a stop.
        """

    def confirmed_off(self) -> Sequence[bool] | None:
        """Return of each axis whether its drive has confirmed to be off; else it may be on.

        Asked after communication has ended. None: not kept; the last image says it.
        """
        return None

    @abstractmethod
    def clear_alarm(self, axis: int, timeout_s: float) -> None:
        """Clear the alarm and wait until it is gone. Without an alarm: no effect."""

    @abstractmethod
    def move(self, axis: int, target: float, profile: Profile) -> None:
        """Start a move to an absolute target (rad or m); return when it is accepted.

        A running move or velocity command is overridden without a jump. From then on its ramps are
        those of the new profile, and so is that of a stop. A driver may reject a move while the
        axis stops; one that it accepts is made.
        """

    @abstractmethod
    def stop(self, axes: Sequence[int]) -> None:
        """Start a controlled stop of whatever moves the axes. Idle axes: no effect.

        A running stop is not prolonged, be it a quick stop. A move or velocity command ends with
        the deceleration of its profile, a stream with a ramp of the driver's own. A stream of
        torques ends with position control: the axis holds where it has come to rest. Returns at
        once: a stop that waits delays the next one.
        """

    def quick_stop(self, axes: Sequence[int]) -> None:
        """Start the fastest controlled stop. Idle axes: no effect. Returns at once.

        It takes over a running stop.
        """
        self.stop(axes)

    def begin_stream(self, axes: Sequence[int]) -> None:
        """Let ``axes`` follow ``stream`` from their present command, without a jump.

        Each is in ``Operation.STREAM`` until ``end_stream``, or until something stops it.
        Until the first setpoint an axis at rest stays there. Axes in position and in velocity mode
        may stream together. Where one of them cannot stream, none does. An axis that streams
        already goes on, also where the call is rejected for it. Not needed with
        TRAJECTORIES_ON_DEVICE, except for velocity streams.
        """
        raise Unsupported("streamed setpoints")

    def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
        """Take one setpoint per axis, to be reached at ``due_ns``. Control-loop thread.

        An axis in position mode passes through its position at its velocity; one in velocity
        mode changes evenly to its velocity, and its position is ignored. Only axes between
        ``begin_stream`` and ``end_stream`` obey; the others' entries are ignored. Ignored
        entries may be NaN. An axis that ``ProcessImage.silent`` names gets no setpoint: until its
        drive answers it keeps the command that it has, and then continues from
        ``position_command``. After missing setpoints the next one continues where ``underrun``
        leads. The arrays are overwritten by the caller after the call.

        Args:
            position, velocity: (n_axes,) in rad or m, and per second.
            due_ns: monotonic time, at most one period ahead. The control loop sends nothing to a
                device that extrapolates when less than half a period is left; a process may
                still be stopped between that check and the device.

        Raises:
            LateSetpoint: the device was not given the setpoint, because it came too late. The
                next one allows for that.
        """
        raise Unsupported("streamed setpoints")

    def stream_torque(self, torque: FloatArray, due_ns: int) -> None:
        """Take one torque per axis (TORQUE_MODE). Control-loop thread.

        It acts until the next one. Only axes in torque mode between ``begin_stream`` and
        ``end_stream`` obey. Setpoints that are missing for too long have to stop the axes.

        Args:
            torque: (n_axes,) in N·m or N; NaN: unchanged, at first the torque that holds the axis.
            due_ns: see ``stream``.
        """
        raise Unsupported("torque setpoints")

    def stream_ran_dry(self, due_ns: int) -> bool:
        """Return True when a setpoint for ``due_ns`` would be ignored. Control-loop thread.

        For devices that hold setpoints ahead (``stream_buffer_s``): they have executed the last
        one in motion and stand, though no setpoint was missing. The control loop sends none then;
        the axes continue with the first one after a gap that counts as an underrun.
        """
        return False

    def end_stream(self, axes: Sequence[int]) -> None:
        """Hold the last setpoint (velocity mode: slow to rest); the axes take moves again.

        A last setpoint of velocity 0 is reached, also if it is due later. An axis that does not
        stream: no effect.
        """
        raise Unsupported("streamed setpoints")

    def follow(self, axes: Sequence[int], times_s: FloatArray, positions: FloatArray) -> None:
        """Start a trajectory that the device interpolates (TRAJECTORIES_ON_DEVICE).

        Returns when the device has taken all points and started. The axes, idle before, are in
        ``Operation.STREAM`` until they have arrived (then ``motion_complete``) or something
        stops them; ``stop`` slows them down together, along the path, as fast as their limits
        allow, however gentle the trajectory is.

        Args:
            axes: m axes, in position mode.
            times_s: (k,) increasing, from 0; k ≤ ``max_trajectory_points``.
            positions: (k, m); the first is the present command.

        Raises:
            OperationError: the device rejects it, with the reason; nothing moved.
        """
        raise Unsupported("trajectories on the device")

    def stop_trajectory(self, axes: Sequence[int], duration_s: float) -> None:
        """Start to stop what ``follow`` started, all its axes together along the path.

        Returns at once. Axes at rest: no effect. The default is ``stop``.

        Args:
            axes: those of ``follow``.
            duration_s: time in which the path's rate falls to 0; the joints' own limits allow it.
        """
        self.stop(axes)

    def set_command_mode(self, axis: int, mode: CommandMode) -> None:
        """Change the command mode of an idle axis; nothing moves (VELOCITY_MODE, TORQUE_MODE).

        An axis in torque mode holds its position until ``begin_stream``. Raises Unsupported: a mode
        that is not declared.
        """
        if mode is not CommandMode.POSITION:
            raise Unsupported(f"{mode.name.lower()} mode")

    def jog(self, axis: int, profile: Profile) -> None:
        """Start or change a velocity command, signed ``profile.velocity`` (VELOCITY_MODE).

        The speed falls by the deceleration of this profile, also to a turn, and rises by its
        acceleration. Velocity 0 slows to rest, after which the axis is idle.
        """
        raise Unsupported("velocity mode")

    def begin_guiding(self, axes: Sequence[int], timeout_s: float) -> None:
        """Let idle, enabled ``axes`` be moved by hand; wait until they can be (HAND_GUIDING).

        Each is in ``Operation.GUIDING`` until something stops it. It gets no targets, and its
        command is its measured position. A drive that has to be off for it is shown as off. Where
        one of them cannot be guided, none is; axes of a servo group are guided together or not.

        ``stop`` and ``quick_stop`` end it: the axis is held where it comes to rest, enabled. One
        that cannot be held is off, with the reason in ``ProcessImage.reason``. Servo off ends it,
        too, and so do an alarm and the end of communication.
        """
        raise Unsupported("hand guiding")

    def homing_speed(self, axis: int) -> float:
        """Return the highest speed of the axis' homing, rad/s or m/s; 0: it does not move.

        Read at each homing, which ``search_home`` runs where it moves, else ``home``.
        """
        return 0.0

    def home(self, axis: int, timeout_s: float) -> None:
        """Make the present position zero, without moving; wait for it (HOMING).

        The command is zero then, too. Polarity and gear ratio stay. With the servo off: the same,
        or OperationError. Not called for an axis whose homing moves.
        """
        raise Unsupported("homing")

    def search_home(self, axis: int, max_speed: float, timeout_s: float) -> None:
        """Move to the home position and make it known; wait for it (HOMING).

        Only an axis with a ``homing_speed`` is asked for it. It stops as a move does, and the
        command is the position in the end.

        ``max_speed``: bound of the speed, rad/s or m/s, at most ``homing_speed``.
        """
        raise Unsupported("homing that moves")

    def set_polarity(self, axis: int, polarity: int) -> None:
        """Set 1 or -1, servo off; the measured position changes sign (SCALING).

        The gear ratio stays, and so does the place of the home position.
        """
        raise Unsupported("polarity")

    def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
        """Set encoder counts = units · numerator / denominator, servo off (SCALING).

        The polarity stays, and so does the place of the home position.
        """
        raise Unsupported("gear ratio")


class IoDriver(ABC):
    """The digital I/O image. Reads answer from the last cycle and never block."""

    @property
    @abstractmethod
    def input_bytes(self) -> int:
        """Size of the input image."""

    @property
    @abstractmethod
    def output_bytes(self) -> int:
        """Size of the output image."""

    @property
    def live(self) -> tuple[memoryview, memoryview] | None:
        """Images of inputs and outputs that are updated in place, to record every period.

        Each begins at address 0; of a large image its first 256 bytes are enough. They stay the
        same ones when the device is closed and opened again. None: they are only read by calls.
        """
        return None

    @abstractmethod
    def read_inputs(self, byte: int, length: int) -> bytes:
        """``length`` bytes of the input image from address ``byte``. Any thread."""

    @abstractmethod
    def read_outputs(self, byte: int, length: int) -> bytes:
        """``length`` bytes of the output image from address ``byte``. Any thread."""

    @abstractmethod
    def write_outputs(self, byte: int, data: bytes) -> None:
        """Write whole bytes of the output image. Any thread."""

    @abstractmethod
    def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
        """Write one output bit and leave its neighbours alone, atomically. Any thread."""


class FieldbusDriver(ABC):
    """Diagnostics of the fieldbuses of a device. Worker threads only."""

    @property
    @abstractmethod
    def buses(self) -> int:
        """Number of fieldbuses, numbered 0 … buses - 1."""

    @abstractmethod
    def status(self, bus: int) -> BusStatus:
        """Return the status of one bus and its nodes, in any state of the device.

        While the device communicates, a node that is offline is not operational, and has a fault
        or an error code.
        """

    def node_ids(self, bus: int) -> Sequence[int]:
        """Return the ids of the nodes in ``status``; override it where that asks the bus."""
        return [node.id for node in self.status(bus).nodes]

    @property
    def register_bytes(self) -> int:
        """Size of the register memory of a node, bytes; ``read_register`` stays inside."""
        return 1 << 16

    def read_register(self, bus: int, node: int, address: int, length: int) -> bytes:
        """Return raw register memory of a node (REGISTER_READ), read anew by each call."""
        raise Unsupported("register_read")

    def reset_statistics(self, bus: int) -> None:
        """Zero the counters of ``status`` (STATISTICS)."""
        raise Unsupported("reset_statistics")

    def start_hot_connect(self, bus: int) -> None:
        """Let newly attached nodes join (HOT_CONNECT)."""
        raise Unsupported("hot connect")

    def read_object(self, bus: int, node: int, index: int, subindex: int) -> bytes:
        """Return an object of a node as it is on the bus (OBJECTS).

        Little-endian, and read anew by each call.

        Raises OperationError with the node's abort code, DeviceTimeout without an answer.
        """
        raise Unsupported("read_object")

    def write_object(self, bus: int, node: int, index: int, subindex: int, data: bytes) -> None:
        """Write an object of a node; no axis of the device moves (OBJECTS).

        What the driver remembers of objects that it writes itself is no longer valid. Raises the
        errors of ``read_object``.
        """
        raise Unsupported("write_object")
