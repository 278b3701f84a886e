"""Trajectory that robotd streams to the device, one setpoint per control period."""

from __future__ import annotations

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS
from robotd.control.command_return import CommandReturn
from robotd.control.completion import Completion, Outcome
from robotd.control.execution_phase import Phase
from robotd.control.path_rate import PathRate
from robotd.control.setpoint_source import SetpointSource
from robotd.control.stall_recovery import StallRecovery, after_stall
from robotd.device.process_image import ProcessImage
from robotd.device.speed_scale import SpeedScale
from robotd.device.state import Underrun
from robotd.motion import JointLimits, MotionState, Sampler, StopPlan, Trajectory, plan_stop


class StreamedTrajectory:
    """Setpoints on the path or along a stop, with recovery from control-loop stalls.

    A ``TrajectorySource``.

    Args:
        trajectory: planned and checked.
        limits: of the same joints.
        start_ns: monotonic time of the trajectory's time 0; it moves while the rate is not 1.
        underrun: behaviour of the device when setpoints are missing.
        buffer_s: duration of the setpoints that the device holds ahead, s.
        speed: sets the rate of trajectory time; None: real time.

    Attributes:
        completion: gets a fault when a stall has led too far off the path.
        stall_recovery: passed on to the successor, which continues its deviation.
    """

    streams = True

    def __init__(
        self,
        trajectory: Trajectory,
        limits: JointLimits,
        start_ns: int,
        *,
        underrun: Underrun = Underrun.EXTRAPOLATE,
        buffer_s: float = 0.0,
        speed: SpeedScale | None = None,
    ) -> None:
        self.start_ns = start_ns
        self.time_s = 0.0
        self.setpoint: FloatArray = np.vstack(trajectory.evaluate(np.zeros(1)))
        self._motion = self.setpoint[:2]  # position and velocity
        self._trajectory, self._limits = trajectory, limits
        self.completion = Completion()
        self._sampler = Sampler(trajectory)
        self._rate = PathRate(speed or SpeedScale(), limits)
        self._path: FloatArray = np.zeros_like(self.setpoint[1:])  # its derivatives at rate 1
        self._due_ns = start_ns
        self._sent_time_s: float | None = 0.0  # of the last setpoint; None: it was off the path
        self._stop_plan: StopPlan | None = None
        self._stop_ns = start_ns
        self._held: FloatArray = np.zeros_like(self.setpoint)  # last position, at rest
        self._held[0] = self.setpoint[0]
        self.stall_recovery = StallRecovery(self._held[:2], start_ns, limits, underrun, buffer_s)
        self._command_return: CommandReturn | None = None
        self._return_ns = start_ns

    @property
    def on_path(self) -> bool:
        """The setpoint does not deviate from the path."""
        return not self.stall_recovery.active

    @property
    def rate(self) -> float:
        """Ratio of trajectory time to real time. Any thread."""
        return self._rate.value

    def begin(self) -> None:
        """Do nothing: the control loop sends the setpoints."""

    def splice_state(self, time_ns: int) -> MotionState | None:
        """Return the state at ``time_ns`` if the path is not left until then."""
        time_s = (time_ns - self.start_ns) / NANOSECONDS
        state = self._trajectory.state_at(time_s)
        return MotionState.at_rest(state.position) if time_s < 0.0 else state

    def take_over(self, running: SetpointSource) -> None:
        """Continue from the setpoint, the rate and the deviation of ``running``."""
        self.setpoint[:] = running.setpoint
        self._rate.value = running.rate
        self._sent_time_s = None
        if running.stall_recovery is not None:
            self.stall_recovery = running.stall_recovery
            self.stall_recovery.begin_path(self.start_ns)

    def sent(self, due_ns: int) -> None:
        """Note that ``setpoint`` was handed to the device, to be reached at ``due_ns``."""
        self._sent_time_s = self.time_s if self.on_path else None
        self.stall_recovery.sent(self._motion, due_ns, self.time_s)

    def expect(self, time_ns: int, phase: Phase, image: ProcessImage, out: FloatArray) -> float:
        """Write the command that the device has at ``time_ns`` into ``out`` (2, m).

        Returns its trajectory time.
        """
        return self.stall_recovery.expect(time_ns, out)

    def move(self, time_ns: int, due_ns: int, pause_ns: int, image: ProcessImage) -> Phase | None:
        """Compute the setpoint for ``due_ns``, at the rate of the operator or along the stop."""
        period_ns, at_rest = due_ns - time_ns, False
        if self._stop_plan is None:
            scaled = self._advance_time(due_ns, period_ns)
            self._sampler.sample(self.time_s, self.setpoint)
            self._path[:] = self.setpoint[1:]
            if scaled:
                self._rate.scale(self.setpoint)
        else:
            at_rest = self._sample_stop(self._stop_plan, due_ns)
        self._held[0] = self.setpoint[0]
        self._recover(due_ns, period_ns)
        if self.stall_recovery.active:
            return None
        if at_rest or self.time_s >= self._trajectory.duration_s:
            return Phase.ARRIVING if self._stop_plan is None else Phase.RESTING
        return None

    def _sample_stop(self, stop_plan: StopPlan, due_ns: int) -> bool:
        """Sample the path along the stop; return True at its end."""
        elapsed_s = (due_ns - self._stop_ns) / NANOSECONDS
        self.time_s, rate, deceleration = stop_plan.at(elapsed_s)
        self._sampler.sample(self.time_s, self.setpoint)
        _, velocity, acceleration = self.setpoint
        acceleration *= rate**2
        acceleration -= velocity * deceleration
        velocity *= rate
        return rate == 0.0

    def _advance_time(self, due_ns: int, period_ns: int) -> bool:
        """Set ``time_s`` for ``due_ns``; return True while the rate of the operator is not 1."""
        if self._sent_time_s is not None and self.stall_recovery.stood(due_ns, period_ns):
            self._continue_from_standstill(due_ns - period_ns, self._sent_time_s)
        scaled = due_ns > self.start_ns and not self._rate.is_full
        if scaled:
            elapsed_ns = due_ns - self._due_ns if self._due_ns > self.start_ns else period_ns
            mean = self._rate.step(elapsed_ns / NANOSECONDS, *self._path)
            self.start_ns += round((1.0 - mean) * elapsed_ns)
        self._due_ns = due_ns
        self.time_s = (due_ns - self.start_ns) / NANOSECONDS
        return scaled

    def _continue_from_standstill(self, time_ns: int, time_s: float) -> None:
        """Go on from trajectory time ``time_s``, where the device has stood until ``time_ns``."""
        self.start_ns = time_ns - round(time_s * NANOSECONDS)
        self._due_ns = time_ns
        self._rate.stand()

    def hold(self, due_ns: int, period_ns: int) -> None:
        """Stay at the end of the path, or return to it."""
        self.setpoint[:] = self._held
        self._recover(due_ns, period_ns)

    def stop(self, time_ns: int) -> Phase:
        """Plan the stop along the path."""
        self._stop_plan = plan_stop(self._trajectory, self.time_s, self._limits, self.rate)
        self._stop_ns = time_ns
        return Phase.STOPPING

    def is_stopping(self, time_ns: int, image: ProcessImage) -> bool:
        """Return False: the commands are at rest when the stop plan has ended."""
        return False

    def is_active(self, image: ProcessImage) -> bool:
        """Return False: the device moves by setpoints only."""
        return False

    def return_command(self, time_ns: int, offset: FloatArray) -> bool:
        """Move the held setpoint by ``offset`` (m,); return False once it is there."""
        if self._command_return is None:
            self._command_return = CommandReturn(self._held[0], offset, self._limits)
            self._return_ns = time_ns
        time_s = (time_ns - self._return_ns) / NANOSECONDS
        return self._command_return.sample(time_s, self._held)

    def _recover(self, due_ns: int, period_ns: int) -> None:
        """Continue from the position after an underrun; request a fault when too far off."""
        found = self.stall_recovery.lay_over(self._motion, due_ns, period_ns / NANOSECONDS)
        if found:  # the return of the command waits, too
            self._return_ns += round(self.stall_recovery.pause_s * NANOSECONDS)
        if found and self.stall_recovery.is_far.any():
            self.completion.request(Outcome.FAULT, self._deviation_text())

    def _deviation_text(self) -> str:
        recovery = self.stall_recovery
        joint = int(np.argmax(recovery.is_far))
        return (
            f"{self._trajectory.names[joint]} is {abs(recovery.offset[joint]):.3f}"
            f" {self._limits.units[joint]} off its path {after_stall(recovery.pause_s)}"
        )
