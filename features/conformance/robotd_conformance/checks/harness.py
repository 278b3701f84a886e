"""Harness: a started robot that checks move and observe."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from robotd.api import (
    AxisDriver,
    Capability,
    Clock,
    CommandMode,
    FaultInjector,
    FloatArray,
    LateSetpoint,
    MonotonicClock,
    Operation,
    OperationError,
    ProcessImage,
    Profile,
    RobotDescriptor,
    wait_until,
)
from robotd.api.robots import (
    Backend,
    JointTolerance,
    Move,
    Robot,
    SteppedClock,
    TrajectoryExecution,
    TrajectoryRequest,
)
from robotd_conformance.checks.injected_faults import InjectedFaults
from robotd_conformance.checks.interruption import INTERRUPTION
from robotd_conformance.checks.position_guard import PositionGuard
from robotd_conformance.checks.recording import MotionRecorder, MotionSamples
from robotd_conformance.checks.start_pose import StartPose, stated_tolerance

SPEED_RAD_S = 0.8
SETTLED_RAD = 2e-3  # an axis that has moved by less stands still
RAMP_RAD_S2 = 4.0
REACHED_SHARE = 0.9  # of the speed at which two ramps make up a move
STANDSTILL_RAD_S = 0.01
SETTLE_S = 0.1  # granted to an axis to come from its command's end to rest
AT_ONCE = {"read", "stream", "state", "fault", "stop", "quick_stop", "read_inputs", "read_outputs"}

WAIT_S = 10.0  # for what a working backend does in far less


class Harness:
    """A robot, its drivers, and time. One test thread.

    Where the device uses the context's clock, time is simulated: it passes while a check
    waits, in control periods and as fast as the computer can. Otherwise the control loop has its
    thread, as when the robot is served.

    Attributes:
        robot, drivers: the robot, and the drivers behind it.
        wrong_calls: calls of drivers that raised what is not an error of robotd, or that waited and
            have to return at once.
        fault_injector: None where the backend offers none.
        pose: start pose of the run.
        guard: keeps all commands in the room of the axes.
        period_s, feedback_s: control period, and time between two measured values.
        clock: of the device.
        all, joints: all axes, and those of the joints.
        stepped: time is simulated.
    """

    def __init__(
        self,
        backend: Backend,
        descriptor: RobotDescriptor,
        pose: StartPose,
        *,
        uses_context_clock: bool,
        real_time: bool = False,
    ) -> None:
        self.stepped = not real_time and uses_context_clock
        self.clock: Clock = SteppedClock() if self.stepped else MonotonicClock()
        self.drivers = backend.drivers(backend.context(descriptor, self.clock))
        self.wrong_calls: list[str] = []
        self._watch_calls()
        self.robot = Robot(descriptor, backend, self.clock, self.drivers)
        self.fault_injector = self.drivers.make_fault_injector()
        self._faults = (
            InjectedFaults(self.fault_injector, backend.name) if self.fault_injector else None
        )
        self.period_s = 1.0 / descriptor.cycle.rate_hz
        self.feedback_s = max(self.period_s, self.drivers.axes.feedback_period_s)
        self.response_s = self.drivers.axes.response_s
        self.image = self.robot.image
        self.count = len(self.robot.axes)
        self.all = list(range(self.count))
        self.joints = list(self.robot.joint_axes)
        self.pose = pose
        self.guard = PositionGuard(
            pose,
            self.image,
            np.array([limit.acceleration for limit in self.robot.axes.limits]),
            self.period_s,
            self._stop_all,
        )
        for driver in (self.drivers.device, self.drivers.axes):
            vars(driver).update(self.guard.methods(driver))
        self._recorder = MotionRecorder()
        self.robot.control_loop.every(descriptor.cycle.rate_hz, "recorder", self._recorder)
        self.robot.control_loop.every(descriptor.cycle.rate_hz, "start pose", self._track)
        self._running = False

    @property
    def due_ns(self) -> int:
        """Monotonic time at which a setpoint of the present control period is due."""
        return self.image.stamp_ns + self.robot.control_loop.period_ns

    @property
    def plugin_axes(self) -> AxisDriver:
        """The plugin's own axes, guarded: without the time limits and threads of the core."""
        own = vars(self.drivers.axes)["wrapped"]
        guarded = self.guard.methods(own)
        methods = {
            name: getattr(own, name) for name in dir(AxisDriver) if not name.startswith("_")
        } | guarded
        return cast(AxisDriver, SimpleNamespace(**methods))

    def _watch_calls(self) -> None:
        """Note each call of a driver that is wrong whatever a check expects: ``wrong_calls``."""
        drivers = self.drivers
        for driver in (
            drivers.device,
            drivers.axes,
            drivers.io,
            drivers.fieldbus,
            drivers.wrenches,
        ):
            for name, member in inspect.getmembers_static(type(driver)):
                if isinstance(member, staticmethod) and not name.startswith("_"):
                    setattr(driver, name, self._watched(name, getattr(driver, name)))

    def _watched(self, name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        at_once = self.stepped and name in AT_ONCE

        def watched(*given: Any, **named: Any) -> Any:
            began_ns = self.clock.now_ns() if at_once else 0
            try:
                return call(*given, **named)
            except OperationError as error:
                cause = error.__cause__
                # As the isolation of faults words it: a driver may have a cause for its own errors.
                if cause is not None and f"failed: {type(cause).__name__}: {cause}" in str(error):
                    self.wrong_calls.append(f"{error}, which is not an error of robotd")
                raise
            finally:
                # Simulated time is held until something waits. Real time: test_cost, test_locks.
                if at_once and (waited_ns := self.clock.now_ns() - began_ns):
                    self.wrong_calls.append(f"{name} has waited {waited_ns * 1e-9:g} s")

        return watched

    # Life

    def begin(self) -> None:
        """Start the control loop. Nothing is opened."""
        if not self._running:
            self.robot.control_loop.start()
        self._running = True

    def open(self) -> None:
        """Open the device alone, and load what it needs before communication."""
        self.robot.connection.open()
        if self.drivers.device.parameters_before_communication:
            self.robot.connection.apply_parameters()

    def start(self, *, enable: bool = True) -> None:
        """Open, communicate, and switch every axis on (or leave them as they are).

        Axes that are switched on go to the start pose of the run.
        """
        self.begin()
        self.robot.connection.start()
        self.until(lambda: self.robot.connection.ready, "the engine is ready")
        self.until(lambda: bool(np.isfinite(self.image.position).all()), "positions are known")
        self.periods(2)
        axes = self.robot.axes
        tolerance = stated_tolerance(self.robot.descriptor, axes.limits)
        self.pose.begin(self.image.position, axes.limits, axes.names, tolerance)
        if enable:
            self.enable()
            self.return_to_start()

    def enable(self) -> None:
        """Alarms cleared, servos on, in position mode; read-only axes skip the check."""
        if reason := self.drivers.axes.read_only:
            pytest.skip(
                f"the axes of the {self.robot.backend.name} backend are read-only: {reason}"
            )
        for axis in self.all:
            self.robot.axes.clear_alarm(axis)
            if self.image.mode[axis] != CommandMode.POSITION:
                self.robot.axes.set_command_mode(axis, CommandMode.POSITION)
            self.robot.axes.servo(axis, True)
        self.until(lambda: bool(self.image.servo_on.all()), "all servos are on")

    def disable(self) -> None:
        """Switch every servo off."""
        for axis in self.all:
            self.robot.axes.servo(axis, False)
        self.until(lambda: not self.image.servo_on.any(), "all servos are off")

    def stop(self) -> None:
        """Undo faults and shut everything down; the harness is done with."""
        with INTERRUPTION.during_shutdown():
            self.undo_faults()
            self.pose.left = self.image.position.copy() if self.robot.connection.ready else None
            self.robot.shutdown()

    def return_to_start(self) -> None:
        """Move every axis back to the start pose of the run, from rest and enabled.

        Raises AssertionError: it is too far away, or the axes do not get there.
        """
        pose, start = self.pose, self.pose.position
        if start is None or pose.is_commanded(self.image.position_command):
            return
        away = pose.away(self.image.position_command)
        assert away <= pose.max_excursion or self.can(Capability.SIMULATED), (
            f"{away:.3f} rad from the start pose, more than --max-excursion"
            f" {pose.max_excursion:g}: not moved back"
        )
        self.move(self.all, start)
        self.rest()
        missed = self.off_target(start)
        assert not missed, f"not back at the start pose: {'; '.join(missed)}"

    def _track(self, image: ProcessImage) -> None:
        """Control loop: stop a run on hardware that goes too far from its start pose."""
        self.pose.track(image)
        self.guard.track(image)
        if self.pose.exceeded and not self.can(Capability.SIMULATED):
            self._stop_all(self.pose.exceeded)

    def _stop_all(self, reason: str) -> None:
        """Stop all axes, also streams that the core does not know. Any thread; never waits."""
        self.robot.axes.stop_latch.engage(reason)
        self.robot.axes.stops.request(self.all)

    @property
    def injector(self) -> FaultInjector:
        """Fault injector of the backend; the check is skipped where there is none."""
        if self._faults is None:
            pytest.skip(f"the {self.robot.backend.name} backend has no fault injector")
        return cast(FaultInjector, self._faults)

    def undo_faults(self) -> None:
        """Undo what a check has left behind by ``injector``."""
        if self._faults is not None:
            self._faults.undo()

    def set_input_bit(self, byte: int, bit: int, value: bool) -> None:
        """Let a sensor change one input. Raises Unsupported where no module has it."""
        if self.fault_injector is not None:
            self.fault_injector.set_input_bit(byte, bit, value)

    def trip(self, code: int) -> None:
        """Trip the drive of axis 0 with alarm ``code``; wait until it is shown."""
        self.injector.trip(0, code)
        self.until(lambda: bool(self.image.amp_alarm[0]), "the alarm is shown", 1.0)

    @property
    def healthy(self) -> bool:
        """True when ready for the next check: enabled, idle, no alarm."""
        image = self.image
        return bool(
            self.robot.connection.ready
            and image.servo_on.all()
            and not image.amp_alarm.any()
            and (image.mode == CommandMode.POSITION).all()
            and (image.operation == Operation.IDLE).all()
        )

    # Time

    def pass_time(self, seconds: float) -> None:
        """Let ``seconds`` pass."""
        self.clock.sleep_until_ns(self.clock.now_ns() + round(seconds * 1e9))

    def periods(self, count: int) -> None:
        """Let ``count`` control periods pass, or periods of the feedback where that is slower."""
        self.pass_time(count * self.feedback_s)

    def wait_until(self, condition: Callable[[], bool], timeout_s: float = WAIT_S) -> bool:
        """Wait for ``condition``; False when ``timeout_s`` is over."""
        return wait_until(condition, timeout_s, self.clock, self.period_s)

    def until(self, condition: Callable[[], bool], what: str, timeout_s: float = WAIT_S) -> None:
        """Wait for ``condition``. Raises AssertionError, saying ``what`` did not come true."""
        if not self.wait_until(condition, timeout_s):
            raise AssertionError(f"not within {timeout_s:g} s: {what}")

    @contextmanager
    def recording(self) -> Iterator[MotionSamples]:
        """Every period's values while the block runs."""
        slow = self.drivers.axes.feedback_period_s > 0.0
        recording = MotionSamples(self.period_s, slow=slow)
        self._recorder.fill(recording)
        try:
            yield recording
        finally:
            self._recorder.fill(None)

    @contextmanager
    def each_period(self, task: Callable[[ProcessImage], None]) -> Iterator[None]:
        """Call ``task(image)`` in every period while the block runs, in the control loop.

        The first exception of ``task`` ends these calls, and is raised after the block.
        """
        errors = list[Exception]()

        def guarded(image: ProcessImage) -> None:
            if not errors:
                try:
                    task(image)
                except Exception as error:  # noqa: BLE001 - raised after the block
                    errors.append(error)

        self._recorder.call(guarded)
        try:
            yield
        finally:
            self._recorder.call(None)
        if errors:
            raise errors[0]

    def set_velocity_mode(self) -> None:
        """Put all axes into velocity mode."""
        for axis in self.all:
            self.robot.axes.set_command_mode(axis, CommandMode.VELOCITY)

    def stream(self, position: FloatArray, velocity: FloatArray) -> None:
        """Control loop: send setpoints (n_axes,) of this period; too late, they are left out."""
        with suppress(LateSetpoint):
            self.drivers.axes.stream(position, velocity, self.due_ns)

    # Motion

    @property
    def wrong_positions(self) -> FloatArray:
        """(n_axes,) positions of setpoints that have to be ignored; no harm if they are not."""
        return np.asarray(np.clip(1.0, *self.pose.room))

    def travel(self, share: float = 1.0) -> FloatArray:
        """(n_axes,) distances to move by, all different, to the sides of the start pose."""
        return self.pose.travel(share)

    def speeds(self, share: float) -> FloatArray:
        """(n_axes,) velocities at ``share`` of each profile, in the directions of ``travel``."""
        fastest = [self.profile(axis, share).velocity for axis in self.all]
        return np.sign(self.travel()) * fastest

    def profile(self, axis: int, share: float = 1.0) -> Profile:
        """A gentle profile within the limits of the axis, at ``share`` of its speed.

        On the way of ``travel`` the axis reaches that speed.
        """
        limits = self.robot.axes.limits[axis]
        ramp = min(RAMP_RAD_S2, 0.5 * limits.acceleration)
        reached = REACHED_SHARE * math.sqrt(ramp * abs(float(self.travel()[axis])))
        speed = min(SPEED_RAD_S, 0.5 * limits.velocity, reached) * share
        return Profile(speed, ramp, ramp)

    def move(
        self, axes: Sequence[int], targets: FloatArray, profiles: Sequence[Profile] | None = None
    ) -> None:
        """Start moves of ``axes`` to ``targets[axis]`` (n_axes,), by ``profiles[axis]``."""
        chosen = profiles or [self.profile(axis) for axis in self.all]
        self.robot.axes.move([Move(axis, float(targets[axis]), chosen[axis]) for axis in axes])

    def move_all(self, share: float = 1.0, *, speed: float = 1.0) -> FloatArray:
        """Start moves of all axes by ``travel(share)``; return their targets (n_axes,)."""
        targets = self.image.position_command + self.travel(share)
        self.move(self.all, targets, [self.profile(axis, speed) for axis in self.all])
        return targets

    def off_target(self, targets: FloatArray, axes: Sequence[int] | None = None) -> list[str]:
        """Return a line for each of ``axes`` (all) that rests elsewhere than at its target.

        A robot whose file states a goal tolerance, as axes that give way need, has that one.

        Args:
            targets: (n_axes,) rad or m.
        """
        position, tolerance = self.image.position, self.pose.tolerance
        return [
            f"axis {axis} is {abs(position[axis] - targets[axis]):.4f} {self.pose.units[axis]} from"
            f" its target {targets[axis]:.4f}, more than {tolerance[axis]:.2g}"
            for axis in (self.all if axes is None else axes)
            if not abs(position[axis] - targets[axis]) <= tolerance[axis]
        ]

    def rest(self, axes: Sequence[int] | None = None) -> None:
        """Wait until ``axes`` (all) execute nothing and stand still.

        Raises AssertionError naming them otherwise.
        """
        chosen = self.all if axes is None else list(axes)

        def idle() -> bool:
            return all(map(self._is_idle, chosen))

        # A command may need some periods to show in the image.
        self.periods(10)
        if not self.wait_until(idle):
            moving = [self._motion(axis) for axis in chosen if not self._is_idle(axis)]
            raise AssertionError(f"not at rest after {WAIT_S:g} s: {'; '.join(moving)}")
        self.pass_time(SETTLE_S)

    def _is_idle(self, axis: int) -> bool:
        speed, operation = self.image.velocity[axis], self.image.operation[axis]
        return bool(operation == Operation.IDLE and abs(speed) < STANDSTILL_RAD_S)

    def _motion(self, axis: int) -> str:
        image, unit = self.image, self.robot.axes.limits[axis].unit
        return (
            f"axis {axis} is in {Operation(int(image.operation[axis])).name} at"
            f" {image.velocity[axis]:.3g} {unit}/s (at rest below {STANDSTILL_RAD_S:g}), position"
            f" {image.position[axis]:.4f}, command {image.position_command[axis]:.4f} {unit}"
        )

    @contextmanager
    def following(
        self,
        times_s: Sequence[float],
        rows: Sequence[FloatArray],
        velocities: bool = False,
        path: Sequence[JointTolerance] = (),
    ) -> Iterator[TrajectoryExecution]:
        """Follow a trajectory of all joints; leaving the block ends it.

        Args:
            rows: one position row per point, shape (joints,), relative to the present command.
            velocities: give velocities too (those of a smooth path), so that it is cubic.
            path: tolerances on the way, other than the descriptor's.
        """
        start = self.image.position_command[self.joints].copy()
        points = [list(start + row) for row in rows]
        slopes = np.gradient(np.array([np.zeros(len(self.joints)), *rows]), [0.0, *times_s], axis=0)
        slopes[-1] = 0.0
        request = TrajectoryRequest.from_rows(
            self.robot.joint_names,
            times_s,
            points,
            [list(row) for row in slopes[1:]] if velocities else (),
        )
        tolerances = self.robot.follower.tolerances(path)
        with self.robot.follower.follow(request, tolerances) as execution:
            try:
                yield execution
            finally:
                execution.cancel()
                self.wait_until(lambda: execution.done)

    def follow(
        self, times_s: Sequence[float], rows: Sequence[FloatArray], *, velocities: bool = False
    ) -> TrajectoryExecution:
        """Follow a trajectory until it ends; arguments: see ``following``."""
        with self.following(times_s, rows, velocities) as execution:
            self.until(lambda: execution.done, "the trajectory ends")
        return execution

    def servo_group(self, axis: int) -> list[int]:
        """Return the axes that are switched with ``axis``, itself included."""
        return list(self.robot.axes.servo_group(axis))

    def alarm_group(self, axis: int) -> list[int]:
        """Return the axes that an alarm of ``axis`` concerns, itself included."""
        return self.all if self.can(Capability.CONTROLLER_ALARM) else [axis]

    def can(self, capability: Capability) -> bool:
        return capability in self.robot.capabilities

    def require_rescaling(self) -> None:
        """Skip the check where a change of scale or home cannot be undone."""
        if not self.can(Capability.SIMULATED) and self.robot.descriptor.parameters_file is None:
            pytest.skip("would change the drives for good: the robot has no parameter file")


MakeHarness = Callable[..., Harness]
"""Fixture ``make_harness``; keywords: see ``KitTarget.build``."""
