"""One trajectory on its way: what the cycle does with it each period, and how it ends."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from enum import Enum, auto

import numpy as np

from robotd.arrays import FloatArray, IntArray
from robotd.clock import NANOSECONDS, Clock
from robotd.clock.simulated import wait_for_event
from robotd.control.command_return import CommandReturn
from robotd.control.stall_recovery import StallRecovery
from robotd.device.process_image import ProcessImage, columns
from robotd.device.state import Operation, Underrun
from robotd.motion import (
    JointLimits,
    MotionState,
    Sampler,
    StopPlan,
    Tolerances,
    Trajectory,
    plan_stop,
)

SETTLED_PERIODS = 3  # consecutive periods within tolerance that count as arrived, or at rest
REST_TIMEOUT_S = 2.0  # a joint that still creeps then is reported, not waited for
STALL_S = 0.02  # a cycle that stood this long may be why a device stopped by itself


class Outcome(Enum):
    """How a trajectory ended."""

    SUCCEEDED = auto()
    CANCELED = auto()
    PREEMPTED = auto()
    PATH_TOLERANCE = auto()
    GOAL_TOLERANCE = auto()
    FAULT = auto()


TOLERANCES = frozenset({Outcome.PATH_TOLERANCE, Outcome.GOAL_TOLERANCE})


class Phase(Enum):
    """RUNNING → ARRIVING → FINISHED, or from either by STOPPING → RESTING → FINISHED."""

    RUNNING = auto()  # on the path, in time
    ARRIVING = auto()  # at the end of the path, until every joint is within its goal tolerance
    STOPPING = auto()  # slowing down along the path
    RESTING = auto()  # the command stands still, until the joints do
    FINISHED = auto()


@dataclass(frozen=True)
class Progress:
    """Where an execution is; arrays (m,) in the order of the trajectory's names."""

    time_s: float
    desired_position: FloatArray
    desired_velocity: FloatArray
    actual_position: FloatArray
    actual_velocity: FloatArray


class TrajectoryExecution:
    """Made by ``TrajectoryFollower.follow``; advanced by the cycle, watched by one worker.

    This one is streamed: it computes setpoints. ``DeviceExecution`` is the other kind.

    Any thread may call ``cancel``, ``wait`` and ``progress``; the rest belongs to the cycle.

    Attributes:
        streams: whether the cycle sends its setpoints.
        trajectory: what is executed, planned and checked.
        start_ns: monotonic time of the trajectory's time 0.
        position, velocity: (m,) the setpoint for the end of the period.
        setpoint: the two as rows of one array, (2, m).
        columns: index of its joints among the device's axes.
        ending: why it is being stopped, None while it is not; set before ``outcome``.
        outcome, message: None and "" until it has ended.
        max_error: (m,) largest following error seen so far, rad or m.
    """

    streams = True

    def __init__(
        self,
        trajectory: Trajectory,
        axes: IntArray,
        limits: JointLimits,
        tolerances: Tolerances,
        start_ns: int,
        stopped_velocity: float,
        *,
        underrun: Underrun = Underrun.EXTRAPOLATE,
    ) -> None:
        joints = len(trajectory.names)
        self.trajectory = trajectory
        self.start_ns = start_ns
        self.ending: tuple[Outcome, str] | None = None
        self.outcome: Outcome | None = None
        self.message = ""
        self.max_error: FloatArray = np.zeros(joints)
        position, velocity, _ = (part[0] for part in trajectory.evaluate(np.zeros(1)))
        self.setpoint: FloatArray = np.array([position, velocity])
        self.position, self.velocity = self.setpoint
        self._phase = Phase.RUNNING
        self._axes, self.columns = axes, columns(axes)
        self._followed = False
        self._limits = limits
        self._tolerances = tolerances
        self._stopped_velocity = stopped_velocity
        self._sampler = Sampler(trajectory)
        self._time_s = 0.0
        self._stop: StopPlan | None = None
        start = np.array([position, np.zeros(joints)])
        self._stall_recovery = StallRecovery(start, start_ns, limits, underrun)
        # Where the joints are held: the end of the path, or as far as it has come.
        self._held: FloatArray = np.array([position, np.zeros(joints)])
        self._aim: FloatArray = self.setpoint.copy()
        self._desired, self._desired_velocity = self._aim
        self._measured: FloatArray = self.setpoint.copy()
        self._actual, self._actual_velocity = self._measured
        self._sound = b""  # flags and operations of an image with which all was well
        self._error: FloatArray = np.zeros(joints)
        self._phase_ns = start_ns
        self._stop_ns = start_ns
        self._advanced_ns = start_ns
        self._pause_ns = 0
        self._settled_periods = 0
        # Replaced as a whole: another thread sees the values of one period.
        self._snapshot = (0.0, self._aim.copy(), self._measured.copy())
        self._return: CommandReturn | None = None
        self._return_ns = start_ns
        self._done = threading.Event()

    @property
    def done(self) -> bool:
        """True once ``outcome`` stands."""
        return self._done.is_set()

    @property
    def on_path(self) -> bool:
        """It runs, or has run, along its path to the end; what was planned to follow it fits."""
        if self.outcome is None:
            return self.ending is None
        return self.outcome is Outcome.SUCCEEDED

    def cancel(self) -> None:
        """Ask for a controlled stop; the outcome comes at standstill. Late calls: no effect."""
        self._end(Outcome.CANCELED, "canceled by the client")

    def wait(self, timeout_s: float | None = None) -> bool:
        """Block until it has ended; False when ``timeout_s`` (None: for ever) is over."""
        return self._done.wait(timeout_s)

    def wait_until(self, deadline_ns: int, clock: Clock) -> None:
        """Block until it has ended, or until ``deadline_ns`` on ``clock``."""
        wait_for_event(self._done, deadline_ns, clock)

    def progress(self) -> Progress:
        """Values of one control period: the path at ``time_s`` and what was measured then."""
        time_s, desired, actual = self._snapshot
        return Progress(time_s, desired[0], desired[1], actual[0], actual[1])

    def splice_state(self, time_ns: int) -> MotionState | None:
        """The commanded state at ``time_ns`` if nothing happens until then.

        None while it is being stopped: then only the standstill to come is certain.
        """
        if not self.on_path:
            return None
        time_s = (time_ns - self.start_ns) / NANOSECONDS
        state = self.trajectory.state_at(time_s)
        return MotionState.at_rest(state.position) if time_s < 0.0 else state

    def begin(self) -> None:
        """Follower: it was submitted and will run."""

    def take_over(self, running: TrajectoryExecution) -> None:
        """SetpointMixer: the setpoint that the joints are reaching now is one of ``running``."""
        self.setpoint[:] = running.setpoint
        self._stall_recovery, self._advanced_ns = running._stall_recovery, running._advanced_ns

    def sent(self, due_ns: int) -> None:
        """SetpointMixer: ``setpoint`` was handed to the device, to be reached at ``due_ns``."""
        self._stall_recovery.sent(self.setpoint, due_ns)

    def advance(self, time_ns: int, period_ns: int, image: ProcessImage) -> None:
        """Cycle: judge the measured values of ``time_ns``, compute the setpoint one period on."""
        if self._phase is Phase.FINISHED:
            return
        self._pause_ns, self._advanced_ns = time_ns - self._advanced_ns, time_ns
        self._observe(image, time_ns)
        self._check_drives(image)
        if self._phase in (Phase.RUNNING, Phase.ARRIVING):
            self._judge(time_ns)
        match self._phase:
            case Phase.RUNNING | Phase.STOPPING:
                self._move_on(time_ns + period_ns, time_ns, image)
            case Phase.ARRIVING:
                self._hold(time_ns + period_ns, period_ns)
                self._arrive(time_ns)
            case Phase.RESTING:
                self._hold(time_ns + period_ns, period_ns)
                self._rest(time_ns, image)

    def finish(self, outcome: Outcome, message: str) -> None:
        """SetpointMixer: this is the end, whatever the joints do. The first outcome stands."""
        if self._phase is not Phase.FINISHED:
            self._phase = Phase.FINISHED
            self.outcome, self.message = outcome, message
            self._done.set()

    def _end(self, outcome: Outcome, message: str) -> None:
        if self.ending is None and self.outcome is None:
            self.ending = (outcome, message)

    def _enter(self, phase: Phase, time_ns: int) -> None:
        self._phase, self._phase_ns, self._settled_periods = phase, time_ns, 0

    def _observe(self, image: ProcessImage, time_ns: int) -> None:
        self._measured[:] = image.measured[:2, self.columns]
        self._expect(time_ns)
        np.subtract(self._desired, self._actual, self._error)
        np.abs(self._error, self._error)
        np.fmax(self.max_error, self._error, self.max_error)
        time_s = self._time_s
        if self._phase is Phase.RUNNING:
            time_s = (time_ns - self.start_ns) / NANOSECONDS
        self._snapshot = time_s, self._aim.copy(), self._measured.copy()

    def _expect(self, time_ns: int) -> None:
        self._stall_recovery.expect(time_ns, self._aim)

    def _check_drives(self, image: ProcessImage) -> None:
        """A drive that does not follow is a fault, also while its neighbours are being stopped."""
        seen = image.flags.tobytes() + image.operation.tobytes()
        if seen == self._sound:
            return
        axes, joints = self._axes, len(self._axes)
        if (
            self._obeyed(image)
            and np.count_nonzero(image.servo_on[axes]) == joints
            and not np.count_nonzero(image.amp_alarm[axes])
            and not np.count_nonzero(image.offline[axes])
        ):
            self._sound = seen
            return
        if self.ending is None:
            self.ending = (Outcome.FAULT, self._fault_text(image))
        elif self.ending[0] is not Outcome.FAULT:
            reason = f"{self._fault_text(image)} (while stopping: {self.ending[1]})"
            self.ending = (Outcome.FAULT, reason)

    def _obeyed(self, image: ProcessImage) -> bool:
        """Nothing but us moves the axes; values from before the stream do not show it yet."""
        following = bool((image.operation[self._axes] == Operation.STREAM).all())
        self._followed |= following
        return following or not self._followed

    def _fault_text(self, image: ProcessImage) -> str:
        """Which joint, when, and what. The joint that is worst off names the reason."""
        what = [
            (image.offline | image.amp_alarm, ""),
            (~image.servo_on, "servo went off"),
            (image.operation != Operation.STREAM, self._stopped_text()),
        ]
        for failed, text in what:
            for name, axis in zip(self.trajectory.names, self._axes, strict=True):
                if failed[axis]:
                    if fault := image.controller_fault:
                        return f"{fault} at {self._time_s:.3f} s"
                    reason = f" ({image.reason[axis]})" if image.reason[axis] else ""
                    said = f"{text}{reason}" if text else image.fault(axis)
                    return f"{name} at {self._time_s:.3f} s: {said}"
        return "a drive does not follow"

    def _stopped_text(self) -> str:
        pause_s = self._pause_ns / NANOSECONDS
        if pause_s < STALL_S:
            return "stopped by the device or another command"
        return f"stopped by the device after the cycle had stood for {pause_s * 1e3:.0f} ms"

    def _judge(self, time_ns: int) -> None:
        # Until a stall is recovered from, the joints are where it left them.
        stalled = self._pause_ns > STALL_S * NANOSECONDS or self._stall_recovery.active
        if self.ending is None and self._phase is Phase.RUNNING and not stalled:
            violation = self._tolerances.check_path(
                self._time_s,
                self._desired,
                self._actual,
                self._desired_velocity,
                self._actual_velocity,
            )
            if violation is not None:
                self._end(Outcome.PATH_TOLERANCE, str(violation))
        if self.ending is not None:
            self._begin_stop(time_ns)

    def _begin_stop(self, time_ns: int) -> None:
        self._stop = plan_stop(self.trajectory, self._time_s, self._limits)
        self._stop_ns = time_ns
        self._enter(Phase.STOPPING, time_ns)

    def _move_on(self, due_ns: int, time_ns: int, image: ProcessImage) -> None:
        """The setpoint for ``due_ns``, on the path at full rate or along the stop."""
        rate = 1.0
        if self._stop is None:
            self._time_s = (due_ns - self.start_ns) / NANOSECONDS
        else:
            self._time_s, rate, _ = self._stop.at((due_ns - self._stop_ns) / NANOSECONDS)
        self._sampler.sample(self._time_s, self.position, self.velocity)
        if rate != 1.0:
            self.velocity *= rate
        self._held[0] = self.position
        self._lead_back(due_ns, due_ns - time_ns)
        if self._stall_recovery.active:
            return
        if rate == 0.0 or (self._stop and self._time_s >= self.trajectory.duration_s):
            self._enter(Phase.RESTING, time_ns)
        elif self._time_s >= self.trajectory.duration_s:
            self._enter(Phase.ARRIVING, time_ns)

    def _hold(self, due_ns: int, period_ns: int) -> None:
        """Stay at the end of the path, or lead the joints back to it."""
        self.setpoint[:] = self._held
        self._lead_back(due_ns, period_ns)

    def _lead_back(self, due_ns: int, period_ns: int) -> None:
        """Continue from where an underrun has led, and end the goal if that is too far off."""
        found = self._stall_recovery.lay_over(self.setpoint, due_ns, period_ns / NANOSECONDS)
        if found and self._stall_recovery.is_far.any():
            self._end(Outcome.FAULT, self._far_text(self._stall_recovery))

    def _far_text(self, stall_recovery: StallRecovery) -> str:
        joint = int(np.argmax(stall_recovery.is_far))
        return (
            f"{self.trajectory.names[joint]} is {abs(stall_recovery.offset[joint]):.3f}"
            f" {self._limits.units[joint]} off its path after the cycle had stood for"
            f" {stall_recovery.pause_s * 1e3:.0f} ms"
        )

    def _arrive(self, time_ns: int) -> None:
        over_s = (time_ns - self._phase_ns) / NANOSECONDS
        violation = self._tolerances.check_goal(
            self.trajectory.duration_s + over_s,
            self._desired,
            self._actual,
            self._actual_velocity,
        )
        settled = violation is None and not self._stall_recovery.active
        self._settled_periods = self._settled_periods + 1 if settled else 0
        if self._settled_periods >= SETTLED_PERIODS:
            self.finish(Outcome.SUCCEEDED, self._success_text())
        elif violation and over_s > self._tolerances.goal_time_s:
            self._end(Outcome.GOAL_TOLERANCE, str(violation))
            self._enter(Phase.RESTING, time_ns)

    def _rest(self, time_ns: int, image: ProcessImage) -> None:
        fast = np.abs(self._actual_velocity) > self._stopped_velocity
        # Of a drive that does not answer the last velocity stays, and says nothing.
        moving = bool((fast & ~image.offline[self._axes]).any())
        self._settled_periods = 0 if moving else self._settled_periods + 1
        timed_out = time_ns - self._phase_ns > REST_TIMEOUT_S * NANOSECONDS
        if self.ending and (self._settled_periods >= SETTLED_PERIODS or timed_out):
            outcome, message = self.ending
            stuck = self.streams and outcome in TOLERANCES and not moving
            if stuck and self._return_command(time_ns):
                return
            self.finish(outcome, f"{message}; joints still move" if moving else message)

    def _return_command(self, time_ns: int) -> bool:
        """Lead the command to where the joints stand; False once it is there."""
        if self._return is None:
            self._return = CommandReturn(self._held[0], self._actual, self._limits)
            self._return_ns = time_ns
        time_s = (time_ns - self._return_ns) / NANOSECONDS
        return self._return.sample(time_s, self._held)

    def _success_text(self) -> str:
        worst = int(np.argmax(self.max_error))
        return (
            f"goal reached after {self.trajectory.duration_s:.3f} s; largest following error"
            f" {self.max_error[worst]:.4f} {self._limits.units[worst]}"
            f" ({self.trajectory.names[worst]})"
        )
