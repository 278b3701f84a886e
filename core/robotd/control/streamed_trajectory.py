"""Trajectory that robotd streams to the device, one setpoint per control period."""

from __future__ import annotations

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS
from robotd.control.command_return import CommandReturn
from robotd.control.completion import Outcome
from robotd.control.joint_source import Phase
from robotd.control.path_rate import PathRate, scale
from robotd.control.source_slot import SetpointSource
from robotd.control.stall_recovery import StallRecovery, after_stall
from robotd.control.trajectory_execution import PlannedGoal, TrajectoryExecution
from robotd.device.axes import Axes
from robotd.device.motion_limits import MotionLimits
from robotd.device.process_image import ProcessImage
from robotd.motion import MotionState, Sampler, StopPlan, plan_stop


class StreamedTrajectory(TrajectoryExecution):
    """Setpoints on the path or along a stop, with recovery from control-loop stalls.

    A fault ends it when a stall has led too far off the path. ``start_ns`` moves while the rate is
    not 1.

    Args:
        robot: axes of the robot, whose speed sets the rate of trajectory time.
        motion_limits: of the group, which lower the rate.
        goal, start_ns: see ``TrajectoryExecution``.
    """

    stall_recovery: StallRecovery

    def __init__(
        self, robot: Axes, motion_limits: MotionLimits, goal: PlannedGoal, start_ns: int
    ) -> None:
        super().__init__(goal, start_ns, feedback_period_s=robot.feedback_period_s)
        # From 30 attributes on CPython takes a third longer for each access.
        self._motion = self.setpoint[:2]  # position and velocity
        self._sampler = Sampler(goal.trajectory)
        self._rate = PathRate(robot.speed, motion_limits, goal.trajectory, goal.limits)
        self._due_ns = 0  # of the last setpoint; 0: none was made
        self._sent_time_s: float | None = 0.0  # of the last setpoint; None: it was off the path
        self._stop_plan: tuple[StopPlan, int] | None = None  # with the time of its beginning
        self._held: FloatArray = np.zeros_like(self.setpoint)  # last position, at rest
        self._held[0] = self.setpoint[0]
        self.stall_recovery = StallRecovery(
            self._held[:2], start_ns, goal.limits, robot.underrun, robot.stream_buffer_s
        )
        self._command_return: CommandReturn | None = None

    @property
    def rate(self) -> float:
        return self._rate.value

    def override_speed(self, ratio: float) -> None:
        self._rate.override = ratio

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
        self._sent_time_s = None
        if running.stall_recovery is not None:
            self.stall_recovery = running.stall_recovery
            self.stall_recovery.begin_path(self.start_ns)
            if self.stall_recovery.left_plan:
                self.stall_recovery.deviate(self.trajectory.state_at(0.0))
                self._check_deviation()

    def sent(self, due_ns: int) -> None:
        self._sent_time_s = None if self.stall_recovery.active else self.time_s
        self.stall_recovery.sent(self._motion, due_ns, self.time_s)

    def _expect(self, time_ns: int, image: ProcessImage, out: FloatArray) -> float:
        return self.stall_recovery.expect(time_ns, out)

    def _move(self, time_ns: int, due_ns: int, pause_ns: int, image: ProcessImage) -> Phase | None:
        """Compute the setpoint for ``due_ns``, at the rate of the operator or along the stop."""
        period_ns, at_rest = due_ns - time_ns, False
        if self._stop_plan is None:
            scaled = self._advance_time(due_ns, period_ns)
            self._sampler.sample(self.time_s, self.setpoint)
            self._rate.path[:] = self.setpoint[1:]
            if scaled:
                scale(self.setpoint, self._rate.value, self._rate.slope)
        else:
            stop_plan, began_ns = self._stop_plan
            self.time_s, rate, deceleration = stop_plan.at((due_ns - began_ns) / NANOSECONDS)
            self._sampler.sample(self.time_s, self.setpoint)
            scale(self.setpoint, rate, -deceleration)
            at_rest = rate == 0.0
        self._held[0] = self.setpoint[0]
        self._recover(due_ns, period_ns)
        if at_rest and self.stall_recovery.active and self._stands(period_ns):
            # A stop need not end on the path: the deviation fades too slowly to be seen, and the
            # client would wait up to 0.3 s more for the result.
            self._held[0] = self.setpoint[0]
            self.stall_recovery.accept()
        if self.stall_recovery.active:
            return None
        if at_rest or self.time_s >= self.trajectory.duration_s:
            return Phase.ARRIVING if self._stop_plan is None else Phase.RESTING
        return None

    def _stands(self, period_ns: int) -> bool:
        """Return True where all joints count as standing and can be held at once."""
        in_one_period = self._limits.acceleration * (period_ns / NANOSECONDS)
        slow = np.minimum(self._stopped_velocity, in_one_period)
        return bool((np.abs(self._motion[1]) <= slow).all())

    def _advance_time(self, due_ns: int, period_ns: int) -> bool:
        """Set ``time_s`` for ``due_ns``; return True while the rate of the operator is not 1."""
        if self._sent_time_s is not None and self.stall_recovery.note_hold(due_ns, period_ns):
            # The device has held the last setpoint until this period: go on from there.
            self._due_ns = due_ns - period_ns
            self.start_ns = self._due_ns - round(self._sent_time_s * NANOSECONDS)
            self._rate.stand()
        scaled = due_ns > self.start_ns and not self._rate.is_full
        if due_ns <= self.start_ns:
            self._rate.wait()
        if scaled:
            elapsed_ns = due_ns - self._due_ns if self._due_ns > self.start_ns else period_ns
            mean = self._rate.step(elapsed_ns / NANOSECONDS, self.time_s)
            self.start_ns += round((1.0 - mean) * elapsed_ns)
        self._due_ns = due_ns
        self.time_s = (due_ns - self.start_ns) / NANOSECONDS
        return scaled

    def _hold(self, due_ns: int, period_ns: int) -> None:
        """Stay at the end of the path, or return to it."""
        self.setpoint[:] = self._held
        self._recover(due_ns, period_ns)

    def _stop(self, time_ns: int) -> Phase:
        """Plan the stop along the path, from the first setpoint on it at the earliest."""
        if not self._due_ns:
            return Phase.RUNNING
        stop_plan = plan_stop(self.trajectory, self.time_s, self._limits, self.rate)
        self._stop_plan = stop_plan, time_ns
        return Phase.STOPPING

    def _return_command(self, time_ns: int, offset: FloatArray) -> bool:
        """Move the held setpoint by ``offset`` (m,); return False once it is there."""
        if self._command_return is None:
            self._command_return = CommandReturn(self._held[0], offset, self._limits, time_ns)
        return self._command_return.sample(time_ns, self._held)

    def _recover(self, due_ns: int, period_ns: int) -> None:
        """Continue from the position after an underrun; request a fault when too far off."""
        if self.stall_recovery.correct(self._motion, due_ns, period_ns / NANOSECONDS):
            if self._command_return is not None:  # it waits, too
                self._command_return.start_ns += round(self.stall_recovery.pause_s * NANOSECONDS)
            self._check_deviation()

    def _check_deviation(self) -> None:
        """Request a fault when too far off the path."""
        recovery = self.stall_recovery
        if recovery.is_far.any():
            joint = int(np.argmax(recovery.is_far))
            text = (
                f"{self.trajectory.names[joint]} is {abs(recovery.offset[joint]):.3f}"
                f" {self._limits.units[joint]} off its path {after_stall(recovery.longest_s)}"
            )
            self.completion.request(Outcome.FAULT, text)
