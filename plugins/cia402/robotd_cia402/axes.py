"""Axes of one fieldbus: the axis driver, which each backend completes with its exchange."""

from __future__ import annotations

from abc import abstractmethod
from collections import deque
from collections.abc import Collection, Sequence
from typing import Any, Generic

from robotd.api import (
    NANOSECONDS,
    AxisDriver,
    Capability,
    Clock,
    CommandMode,
    ConnectionState,
    FloatArray,
    LateSetpoint,
    NotReady,
    Operation,
    Profile,
    RobotdError,
    RobotDescriptor,
    Underrun,
    Unsupported,
    wait_until,
)
from robotd_cia402.axis import Axis, DriveT
from robotd_cia402.commands import Commands
from robotd_cia402.drive_setup import write_quick_stop_ramp
from robotd_cia402.guiding import HandGuiding
from robotd_cia402.modes import HOMING_AT_REST
from robotd_cia402.module_io import ModuleIo
from robotd_cia402.node import HISTORY, Emergency
from robotd_cia402.options import DriveOptions
from robotd_cia402.scaling import Scaling
from robotd_cia402.sync_timing import SyncTiming

_SETTLE_PERIODS = 10  # after which a command returns where no control loop runs


class Cia402Master(AxisDriver, Generic[DriveT]):
    """All axes of one fieldbus, their exchange, and its life cycle.

    Commands go to the axes by workers, one at a time for each axis; the control loop calls
    ``read``, ``stream`` and ``stream_torque``.

    Attributes:
        axes: by axis number.
        guiding: torques of axes that are guided by hand; None: none can be.
        clock, period_s: of the cyclic frames.
        timing: nominal times of the cyclic frames.
        emergencies: the latest of all nodes, newest last.
        io: I/O modules of the bus.
        bus_name: for messages.
        settle_cycles: control periods until the image shows the change that a command has made.
    """

    timing: SyncTiming
    io: ModuleIo[Any, Any]
    bus_name: str
    settle_cycles = 2

    def __init__(self, clock: Clock, period_s: float, stream_timeout_s: float) -> None:
        self.axes: list[Axis[DriveT]] = []
        self.guiding: HandGuiding | None = None
        self.clock, self.period_s = clock, period_s
        self.emergencies: deque[Emergency] = deque(maxlen=HISTORY)
        self._commands: list[Commands] = []
        self._cycles = self._streamed_ns = 0
        self._stream_timeout_s = stream_timeout_s

    def _add_axis(self, options: DriveOptions, drive: DriveT, scaling: Scaling) -> None:
        axis = Axis(options, drive, scaling)
        self.axes.append(axis)
        self._commands.append(Commands(axis, self.clock))

    @property
    @abstractmethod
    def state(self) -> ConnectionState:
        """UNKNOWN while a node or the bus is lost."""

    @abstractmethod
    def fault(self) -> str:
        """Return what is lost, with the causes; "" if nothing is. Any thread."""

    @abstractmethod
    def summary(self) -> str:
        """Return one line about the configured nodes and those that do not answer."""

    @abstractmethod
    def open(self) -> None:
        """Open the bus and identify every node. Raises ConnectError."""

    @abstractmethod
    def close(self) -> None:
        """Close the bus. Twice is not an error."""

    @abstractmethod
    def start(self, timeout_s: float) -> None:
        """Bring the nodes into operation, with their servos off. Raises ConnectError."""

    @abstractmethod
    def force_off(self, axes: Sequence[Axis[DriveT]]) -> None:
        """Switch off drives that have not confirmed it, by all other means; note which confirm.

        Worker, after ``end``.
        """

    @abstractmethod
    def end(self) -> None:
        """End supervision and exchange; the axes are at rest. Raises RobotdError."""

    def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
        """Control loop: take setpoints for the axes that stream, due at ``due_ns``.

        Raises LateSetpoint when they are from before a stall in which the drives have come to
        rest: they would move by the way of one period, and stop again.
        """
        self._streamed_ns = now_ns = self.clock.now_ns()
        if self.timing.after_rest and now_ns > due_ns:
            raise LateSetpoint
        positions, velocities = position.tolist(), velocity.tolist()
        for axis in self.axes:
            if axis.activity.streaming:
                axis.follow(positions[axis.number], velocities[axis.number])

    def stream_torque(self, torque: FloatArray, due_ns: int) -> None:
        self._streamed_ns = self.clock.now_ns()
        torques = torque.tolist()
        for axis in self.axes:
            axis.follow_torque(torques[axis.number])

    @property
    def cautions(self) -> Sequence[str]:
        """Drives that go on by themselves when the connection is lost."""
        found = {
            f"{node.name} need not stop by itself when robotd or the cable is lost: {reason}": None
            for axis in self.axes
            for node in (axis.drive.node,)
            for reason in (node.unwatched, axis.drive.unreacting)
            if reason
        }
        return list(found)

    @property
    def lacking(self) -> Collection[Capability]:
        return () if self.guiding is not None else (Capability.HAND_GUIDING,)

    def begin_guiding(self, axes: Sequence[int], timeout_s: float) -> None:
        if self.guiding is None:
            raise Unsupported("hand guiding")
        self.guiding.require_carried(axes)
        for axis in axes:
            self._commands[axis].prepare_guiding()
        try:
            for axis in axes:
                self._commands[axis].begin_guiding()
        except RobotdError:
            for axis in axes:
                self._commands[axis].leave_torque(Operation.GUIDING)
            raise
        self.settle()

    def guide(self, period_s: float) -> None:
        """Control loop: set the torques of guided axes, after ``Axis.observe`` of all."""
        if self.guiding is not None:
            self.guiding.advance(period_s)

    def stream_problem(self, now_ns: int) -> str:
        """Control loop: name the nodes that stream without a setpoint for too long; "": none."""
        if now_ns - self._streamed_ns <= self._stream_timeout_s * NANOSECONDS:
            return ""
        streaming = [axis.drive.node.name for axis in self.axes if axis.activity.streaming]
        names = ", ".join(dict.fromkeys(streaming))
        return f"{names}: no setpoint for {self._stream_timeout_s:g} s" if names else ""

    @property
    def underrun(self) -> Underrun:
        return Underrun.HOLD  # without frames from the control loop a drive holds its position

    def begin_stream(self, axes: Sequence[int]) -> None:
        for axis in axes:
            self._commands[axis].require_online()
        idle = [axis for axis in axes if not self.axes[axis].activity.streaming]
        try:
            for axis in axes:
                self._commands[axis].prepare_stream()
            self._streamed_ns = self.clock.now_ns()
            for axis in axes:
                self._commands[axis].begin_stream()
        except RobotdError:
            self._streamed_ns = self.clock.now_ns()
            for axis in idle:  # the others go on as they were
                self._commands[axis].end_stream()
                self._commands[axis].leave_torque()
            raise
        self.settle()

    def end_stream(self, axes: Sequence[int]) -> None:
        for axis in axes:
            self._commands[axis].end_stream()
        self.settle()

    def servo(self, axis: int, on: bool, timeout_s: float) -> None:
        commands = self._commands[axis]
        if on:
            commands.enable(timeout_s)
        else:
            commands.disable(timeout_s)
        self.settle()

    def confirmed_off(self) -> Sequence[bool]:
        return [not axis.power.may_be_on for axis in self.axes]

    def clear_alarm(self, axis: int, timeout_s: float) -> None:
        self._commands[axis].clear_alarm(timeout_s)
        self.settle()

    def set_command_mode(self, axis: int, mode: CommandMode) -> None:
        self._commands[axis].set_mode(mode)
        self.settle()

    def set_polarity(self, axis: int, polarity: int) -> None:
        self._require_off(axis)
        scaling = self.axes[axis].scaling
        scaling.change(scaling.counts_per_unit, polarity)

    def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
        self._require_off(axis)
        scaled = self.axes[axis]
        before, polarity = scaled.scaling.counts_per_unit, scaled.scaling.polarity
        scaled.scaling.change(numerator / denominator, polarity)
        scaled.drive.forget_written()
        if scaled.drive.node.online:  # else it is written when the drive is configured again
            try:
                write_quick_stop_ramp(scaled)
            except RobotdError:
                scaled.scaling.change(before, polarity)
                raise

    def homing_speed(self, axis: int) -> float:
        options = self.axes[axis].options
        if options.homing_method in HOMING_AT_REST:
            return 0.0
        return max(options.homing_speed_rad_s, options.homing_creep_rad_s)

    def home(self, axis: int, timeout_s: float) -> None:
        self._commands[axis].home(timeout_s, 0.0)
        self.settle()

    def search_home(self, axis: int, max_speed: float, timeout_s: float) -> None:
        self._commands[axis].home(timeout_s, max_speed)
        self.settle()

    def move(self, axis: int, target: float, profile: Profile) -> None:
        self._commands[axis].move(target, profile)

    def jog(self, axis: int, profile: Profile) -> None:
        self._commands[axis].jog(profile)

    def stop(self, axes: Sequence[int]) -> None:
        for axis in axes:
            self._commands[axis].stop()

    def quick_stop(self, axes: Sequence[int]) -> None:
        for axis in axes:
            self._commands[axis].quick_stop()

    def settle(self) -> None:
        """Worker: wait until the image shows the latest change.

        It returns after some periods where no control loop runs.
        """
        shown, period_s = self._cycles + self.settle_cycles, self.period_s
        limit_s = _SETTLE_PERIODS * period_s
        wait_until(lambda: self._cycles > shown, limit_s, self.clock, period_s / 4)

    def _require_off(self, axis: int) -> None:
        if self.axes[axis].report.powered:
            node = self.axes[axis].drive.node
            text = f"{node.label}: its scale cannot be changed while the servo is on"
            raise NotReady(text, axis=axis)


def name_and_scaling(robot: RobotDescriptor, options: DriveOptions) -> tuple[str, Scaling]:
    """Return name and units of an axis, which may be no joint."""
    for joint in robot.joints:
        if joint.axis == options.axis:
            limits = (joint.lower, joint.upper)
            return joint.name, Scaling(options, joint.rated_effort, joint.velocity, limits)
    return f"axis {options.axis}", Scaling(options, None)
