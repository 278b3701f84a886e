"""Trajectory that robotd streams to the device, one setpoint per control period."""

from __future__ import annotations

import math

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS
from robotd.control.loop.setpoint_source import Outcome, SetpointSource
from robotd.control.loop.stall_recovery import StallRecovery
from robotd.control.sources.joint_source import SourcePhase
from robotd.control.sources.trajectory_execution import (
    CommandReturn,
    PlannedGoal,
    TrajectoryExecution,
)
from robotd.control.sources.trajectory_extension import Extension
from robotd.device.axes import Axes
from robotd.device.motion_limits import MotionLimits
from robotd.device.process_image import ProcessImage
from robotd.device.speed_scale import SpeedScale
from robotd.motion import MotionState, RateBounds, Sampler, StopPlan, Trajectory, plan_stop

MAX_SLOPE = 2.0  # 1/s, for the operator: 100 % to standstill in half a second, limits permitting
MIN_SHARE = 0.2  # of an acceleration limit, for a path that uses all of it by itself
MIN_SPEED = 1e-9  # rad/s; slower joints count as standing
BRAKE_SHARE = 0.5  # of the accelerations, to slow down before a faster part of the path
MIN_BRAKE, MAX_BRAKE = 0.5, 10.0  # 1/s
SAMPLES = 9  # of the path ahead; densest at its beginning
MAX_COMMAND_ERROR = 1e-5  # rad or m, of a device's command at the last point


class StreamedTrajectory(TrajectoryExecution):
    """Setpoints on the path or along a stop, with recovery from stalls and silent drives.

    The path waits while a drive does not answer. A fault ends it when a joint was left too far off
    the path. ``start_ns`` moves while the rate is not 1.

    Args:
        robot: axes of the robot, whose speed sets the rate of trajectory time.
        motion_limits: of the group, which lower the rate.
        goal, start_ns: see ``TrajectoryExecution``.
    """

    stall_recovery: StallRecovery
    _extension: Extension | None = None  # that waits for the next period

    def __init__(
        self, robot: Axes, motion_limits: MotionLimits, goal: PlannedGoal, start_ns: int
    ) -> None:
        super().__init__(
            goal,
            start_ns,
            feedback_period_s=robot.feedback_period_s,
            response_s=robot.response_s,
        )
        # From 30 attributes on CPython takes a third longer for each access.
        self._motion = self.setpoint[:2]  # position and velocity
        self._sampler = Sampler(goal.trajectory)
        self._rate = PathRate(robot.speed, motion_limits, goal)
        self._due_ns = 0  # of the last setpoint; 0: none was made
        self._stop_plan: tuple[StopPlan, int] | None = None  # with the time of its beginning
        self._held: FloatArray = np.zeros_like(self.setpoint)  # last position, at rest
        self._held[0] = self.setpoint[0]
        self.stall_recovery = StallRecovery(
            self._held[:2], start_ns, goal.limits, robot.extrapolation_s, robot.stream_buffer_s
        )
        self._command_return: CommandReturn | None = None
        self._buffers = robot.stream_buffer_s > 0.0

    @property
    def rate(self) -> float:
        return self._rate.value

    def override_speed(self, ratio: float) -> None:
        self._rate.override = ratio

    def extend(self, extension: Extension) -> None:
        self._extension = extension

    def advance(self, time_ns: int, period_ns: int, image: ProcessImage) -> bool:
        if self._extension is not None:
            self._take(self._extension)
            self._extension = None
        return super().advance(time_ns, period_ns, image)

    def _take(self, extension: Extension) -> None:
        """Exchange the trajectory, between two setpoints of their common part."""
        on_path = self._phase is SourcePhase.RUNNING and self._stop_plan is None
        accepted = on_path and self.completion.goes_on and self.time_s <= extension.same_s
        if accepted:
            self.trajectory = extension.trajectory
            self._sampler = Sampler(extension.trajectory)
            self._rate.exchange(extension.trajectory, extension.rate_bounds)
        extension.accepted = accepted

    def splice_state(self, time_ns: int) -> MotionState | None:
        """Return the state at ``time_ns`` if the path is not left until then."""
        if not self.completion.goes_on:
            return None
        time_s = (time_ns - self.start_ns) / NANOSECONDS
        state = self.trajectory.state_at(time_s)
        return MotionState.at_rest(state.position) if time_s < 0.0 else state

    def take_over(self, running: SetpointSource, advanced_ns: int, delay_ns: int) -> None:
        """Continue from the setpoint, the rate and the deviation of ``running``."""
        self._continue(running, advanced_ns, delay_ns)
        if not running.completion.done:
            self._rate.take_over(running.rate)
        if running.stall_recovery is not None:
            self.stall_recovery = running.stall_recovery
            self.stall_recovery.begin_path(self.start_ns)
            if self.stall_recovery.left_plan:
                self.stall_recovery.deviate(self.trajectory.state_at(0.0))
                self._check_deviation()

    def sent(self, due_ns: int) -> None:
        self.stall_recovery.sent(self._motion, due_ns, self.time_s)

    def _expect(self, time_ns: int, image: ProcessImage, out: FloatArray) -> float:
        return self.stall_recovery.expect(time_ns, out)

    def _move(
        self, time_ns: int, due_ns: int, pause_ns: int, image: ProcessImage
    ) -> SourcePhase | None:
        """Compute the setpoint for ``due_ns``, at the rate of the operator or along the stop."""
        period_ns, at_rest = due_ns - time_ns, False
        if self._stop_plan is None:
            silent = image.silent[self.columns]
            self._rate.blocked = bool(silent.any()) or self.stall_recovery.lags
            scaled = self._advance_time(due_ns, period_ns, nobody_answers=bool(silent.all()))
            self._sampler.sample(self.time_s, self.setpoint)
            self._rate.path[:] = self.setpoint[1:]
            if scaled:
                scale(self.setpoint, self._rate.value, self._rate.slope)
        elif (held := self.stall_recovery.held(due_ns, period_ns)) is not None:
            # The stop has ended in a stall: the device is at rest, off the path perhaps.
            self._held[0] = held
            self.setpoint[:] = self._held
            self.stall_recovery.accept()
            return SourcePhase.RESTING
        else:
            stop_plan, began_ns = self._stop_plan
            self.time_s, rate, deceleration = stop_plan.at((due_ns - began_ns) / NANOSECONDS)
            self._sampler.sample(self.time_s, self.setpoint)
            scale(self.setpoint, rate, -deceleration)
            at_rest = rate == 0.0
        self._held[0] = self.setpoint[0]
        self._recover(due_ns, period_ns, image)
        if at_rest and self.stall_recovery.active and self._stands(period_ns):
            # A stop need not end on the path: the deviation fades too slowly to be seen, and the
            # client would wait up to 0.3 s more for the result.
            self._held[0] = self.setpoint[0]
            self.stall_recovery.accept()
        if self.stall_recovery.active:
            return None
        if at_rest or self.time_s >= self.trajectory.duration_s:
            return SourcePhase.ARRIVING if self._stop_plan is None else SourcePhase.RESTING
        return None

    def _stands(self, period_ns: int) -> bool:
        """Return True where all joints count as standing and can be held at once."""
        in_one_period = self._limits.acceleration * (period_ns / NANOSECONDS)
        slow = np.minimum(self._stopped_velocity, in_one_period)
        return bool((np.abs(self._motion[1]) <= slow).all())

    def _advance_time(self, due_ns: int, period_ns: int, *, nobody_answers: bool) -> bool:
        """Set ``time_s`` for ``due_ns``; return True while the rate is not 1."""
        if self.stall_recovery.begins and due_ns - period_ns > self.start_ns:
            # However late the first setpoint is, it is as far on the path as in time.
            self.start_ns = due_ns - period_ns
            self.stall_recovery.rest_until(self.start_ns)
        time_s = self.stall_recovery.wait(due_ns, period_ns, self._rate.value, self._position_at)
        if time_s is not None:  # the device holds until this period
            self._due_ns = due_ns - period_ns
            self.start_ns = self._due_ns - round(time_s * NANOSECONDS)
            self._rate.rest()
        scaled = due_ns > self.start_ns and not self._rate.is_full
        if due_ns <= self.start_ns:
            self._rate.wait()
        elif nobody_answers:
            self._rate.rest()
        if scaled:
            elapsed_ns = due_ns - self._due_ns if self._due_ns > self.start_ns else period_ns
            mean = self._rate.step(elapsed_ns / NANOSECONDS, self.time_s)
            self.start_ns += round((1.0 - mean) * elapsed_ns)
        self._due_ns = due_ns
        self.time_s = (due_ns - self.start_ns) / NANOSECONDS
        return scaled

    def _position_at(self, time_s: float) -> FloatArray:
        return self.trajectory.state_at(time_s).position

    def _hold(self, due_ns: int, period_ns: int, image: ProcessImage) -> None:
        """Stay at the end of the path, or return to it."""
        self.setpoint[:] = self._held
        self._recover(due_ns, period_ns, image)

    def _is_commanded(self, image: ProcessImage) -> bool:
        """Return True when the last point is commanded; buffers may delay it after a stall."""
        if not self._buffers:
            return True
        error = np.abs(image.position_command[self.columns] - self._held[0])
        return bool((error <= MAX_COMMAND_ERROR).all())

    def _stop(self, time_ns: int) -> SourcePhase:
        """Plan the stop along the path, from the first setpoint on it at the earliest."""
        if not self._due_ns:
            return SourcePhase.RUNNING
        stop_plan = plan_stop(self.trajectory, self.time_s, self._limits, self.rate)
        # A device that holds setpoints ahead bridges missing periods: the stop goes on from there.
        self._stop_plan = stop_plan, self._due_ns if self._buffers else time_ns
        return SourcePhase.STOPPING

    def _return_command(self, time_ns: int, offset: FloatArray) -> bool:
        """Move the held setpoint by ``offset`` (m,); return False once it is there."""
        if self._command_return is None:
            self._command_return = CommandReturn(self._held[0], offset, self._limits, time_ns)
        return self._command_return.sample(time_ns, self._held)

    def _recover(self, due_ns: int, period_ns: int, image: ProcessImage) -> None:
        """Continue from where an underrun or a silence has left; fault when that is too far."""
        recovery, period_s = self.stall_recovery, period_ns / NANOSECONDS
        if recovery.correct(self._motion, due_ns, period_s):
            if self._command_return is not None:  # it waits, too
                self._command_return.start_ns += round(recovery.pause_s * NANOSECONDS)
            self._check_deviation()
        silent = image.silent[self.columns]
        if silent.any():
            recovery.hold(self._motion, silent, image.position_command[self.columns], period_s)
            self._check_deviation()

    def _check_deviation(self) -> None:
        """Request a fault when too far off the path."""
        recovery = self.stall_recovery
        if recovery.is_far.any():
            joint = int(np.argmax(recovery.is_far))
            text = (
                f"{self.trajectory.names[joint]} is {abs(recovery.offset[joint]):.3f}"
                f" {self._limits.units[joint]} off its path {recovery.cause}"
            )
            self.completion.request(Outcome.FAULT, text)


class PathRate:
    """Rate of one trajectory's own time, ramped towards the speed of the operator.

    With trajectory time s and rate r = ds/dt the joints move with q'(s)·r and accelerate with
    q''(s)·r² + q'(s)·dr/dt. No joint leaves its path. Control loop; ``value`` may be read by any
    thread.

    Until the trajectory has begun to move, it is the speed in force, without a ramp. Under a limit
    of the group's speed it looks ahead as far as it takes to slow down from rate 1: r² changes by
    2·D with trajectory time, where D is the change of r in real time.

    ``goal``: the accelerations of its limits and its rate bounds count.

    Attributes:
        path: (2, m) velocity and acceleration of the path at rate 1, at the last setpoint.
        value: at the end of the last period.
        slope: its mean change in the last period, 1/s.
        override: part of the speed that this trajectory is to have; any thread may write it.
        blocked: a drive does not answer: slow to 0 as the accelerations allow, and back.
    """

    def __init__(
        self,
        speed: SpeedScale,
        motion_limits: MotionLimits,
        goal: PlannedGoal,
    ) -> None:
        limits = goal.limits
        self.path: FloatArray = np.zeros((2, len(limits.names)))
        self.value, self.slope, self.override = speed.scale, 0.0, 1.0
        self.blocked = False
        self._speed, self._limit = speed, limits.acceleration
        self._motion_limits, self._trajectory = motion_limits, goal.trajectory
        self._bounds = goal.rate_bounds
        slope = BRAKE_SHARE * float((limits.acceleration / limits.velocity).min())
        slope = min(max(slope, MIN_BRAKE), MAX_BRAKE)
        self._ahead_s = np.linspace(0.0, 1.0, SAMPLES) ** 2 / (2.0 * slope)
        self._gain = 2.0 * slope * self._ahead_s
        self._highest = math.inf
        self._max_slope = MAX_SLOPE
        self._waits = True  # nothing has moved yet

    @property
    def is_full(self) -> bool:
        """Trajectory time passes as real time does, and is to go on so."""
        steady = self.value == 1.0 and self.slope == 0.0
        full = self._wanted == 1.0 and self._motion_limits.factors is None and not self.blocked
        return steady and full and not self._waits

    def wait(self) -> None:
        """Take the speed in force: the trajectory waits for its start."""
        if self._waits:
            self.value = self._target

    def take_over(self, rate: float) -> None:
        """Continue from the ``rate`` of a trajectory in motion."""
        self.value, self._waits = rate, False
        _, velocity, acceleration = self._trajectory.evaluate(np.zeros(1))
        self.path[:] = velocity[0], acceleration[0]

    def exchange(self, trajectory: Trajectory, bounds: RateBounds | None) -> None:
        """Look ahead on another trajectory, which is the same up to now."""
        self._trajectory, self._bounds = trajectory, bounds

    def rest(self) -> None:
        """Begin anew from standstill: the device held its position during a stall."""
        self.value, self._max_slope = 0.0, math.inf

    def step(self, elapsed_s: float, time_s: float) -> float:
        """Ramp for ``elapsed_s``, the real time since the last setpoint; return the mean rate.

        ``time_s`` is the trajectory time of that setpoint.
        """
        self._highest = self._highest_at(time_s + elapsed_s * self.value)
        if self.blocked:
            self._highest, self._max_slope = 0.0, math.inf
        self.wait()
        before, target = self.value, self._target
        largest = 0.0
        if target != before:
            highest = math.inf
            if self._highest >= before:  # of the operator: nothing has to be slow by a given place
                highest = self._max_slope
                if self._bounds is not None:
                    fall, rise = self._bounds.slopes(time_s, before)
                    highest = min(highest, fall if target < before else rise)
            largest = elapsed_s * self._largest_slope(highest)
        change = min(max(target - before, -largest), largest)
        if change == target - before:
            self.value, self._max_slope = target, MAX_SLOPE
        else:
            self.value = before + change
        self._waits = self._waits and target == 0.0
        self.slope = (self.value - before) / elapsed_s
        return 0.5 * (before + self.value)

    def _highest_at(self, time_s: float) -> float:
        """Return the highest rate at trajectory time ``time_s`` under the group's limit."""
        factors = self._motion_limits.factors
        if factors is None:
            return math.inf
        position, velocity, _ = self._trajectory.evaluate(time_s + self._ahead_s)
        return math.sqrt(float((factors(position, velocity) ** 2 + self._gain).min()))

    @property
    def _wanted(self) -> float:
        return self._speed.scale * self.override

    @property
    def _target(self) -> float:
        return min(self._wanted, self._highest)

    def _largest_slope(self, highest: float) -> float:
        velocity, acceleration = self.path
        spare = self._limit - np.abs(acceleration) * self.value**2
        allowed = np.maximum(spare, MIN_SHARE * self._limit)
        speed = np.maximum(np.abs(velocity), MIN_SPEED)
        return min(float((allowed / speed).min()), highest)


def scale(setpoint: FloatArray, rate: float, slope: float) -> None:
    """Turn the path's position, velocity and acceleration (3, m) into those in real time.

    Args:
        setpoint: of the path at rate 1; changed in place.
        rate: r.
        slope: dr/dt, 1/s.
    """
    _, velocity, acceleration = setpoint
    acceleration *= rate**2
    acceleration += velocity * slope
    velocity *= rate
