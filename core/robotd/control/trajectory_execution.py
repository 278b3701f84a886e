"""Execution of one trajectory by the control loop: phases, tolerances, outcome."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager

import numpy as np

from robotd.arrays import FloatArray, IntArray
from robotd.clock import NANOSECONDS, Clock
from robotd.clock.simulated import ticks
from robotd.control.command_history import CommandHistory
from robotd.control.completion import Outcome
from robotd.control.execution_phase import Phase, PhaseState
from robotd.control.fault_monitor import STALL_S, FaultMonitor
from robotd.control.goal_passage import GoalPassage
from robotd.control.joint_tracking import JointTracking, Progress
from robotd.control.setpoint_source import SetpointSource
from robotd.control.source_slot import PREEMPTED
from robotd.control.stall_recovery import StallRecovery
from robotd.control.trajectory_source import TrajectorySource
from robotd.device.process_image import ProcessImage, columns
from robotd.motion import JointLimits, MotionState, Tolerances, Trajectory

__all__ = ["PREEMPTED", "Outcome", "Progress", "TrajectoryExecution"]

REST_TIMEOUT_S = 2.0  # after that a joint that still moves is reported, not waited for
TOLERANCES = frozenset({Outcome.PATH_TOLERANCE, Outcome.GOAL_TOLERANCE})


class TrajectoryExecution:
    """Execution of one trajectory, made by ``TrajectoryFollower.follow``.

    A ``SetpointSource``: advanced by the control loop, awaited by one worker. Any thread may
    call ``cancel``, ``wait`` and ``progress``; the rest belongs to the control loop.

    Args:
        source: makes the joints move along ``trajectory``.
        trajectory: planned and checked.
        axes: (m,) index of each joint's axis.
        limits: of the same joints.
        tolerances: of the path and the goal.
        stopped_velocity: (m,) rad/s or m/s below which a joint is at rest.
        feedback_period_s: as of ``AxisDriver``.

    Attributes:
        trajectory: as above.
        columns, setpoint, completion: as of every ``SetpointSource``.
    """

    def __init__(
        self,
        source: TrajectorySource,
        trajectory: Trajectory,
        axes: IntArray,
        limits: JointLimits,
        tolerances: Tolerances,
        stopped_velocity: FloatArray,
        feedback_period_s: float = 0.0,
    ) -> None:
        self.trajectory = trajectory
        self.columns = columns(axes)
        self.setpoint, self.completion = source.setpoint, source.completion
        self._source = source
        self._axes, self._limits, self._tolerances = axes, limits, tolerances
        self._stopped_velocity = stopped_velocity
        self._tracking = JointTracking(source.setpoint[:2])
        delayed = source.streams and feedback_period_s > 0.0
        self._history = CommandHistory() if delayed else None
        self._monitor = FaultMonitor(trajectory.names, axes, streamed=source.streams)
        self._state = PhaseState(source.start_ns)
        goal_s = trajectory.goal_s
        self._passage = None if goal_s is None else GoalPassage(trajectory, goal_s, tolerances)
        self._returning = False  # the command, to joints that did not follow it
        self._advanced_ns = source.start_ns

    @property
    def start_ns(self) -> int:
        """Monotonic time of the trajectory's time 0."""
        return self._source.start_ns

    @property
    def rate(self) -> float:
        """Ratio of trajectory time to real time. Any thread."""
        return self._source.rate

    @property
    def stall_recovery(self) -> StallRecovery | None:
        """Deviation from its path after an underrun, where setpoints are streamed."""
        return self._source.stall_recovery

    @property
    def max_error(self) -> FloatArray:
        """(m,) largest following error so far, rad or m."""
        return self._tracking.max_error

    @property
    def ending(self) -> tuple[Outcome, str] | None:
        """Outcome and message of the requested end, None: none requested."""
        return self.completion.requested

    @property
    def outcome(self) -> Outcome | None:
        """Result; None until it is known, see ``wait``."""
        return self.completion.result[0] if self.completion.result else None

    @property
    def message(self) -> str:
        """Reason of ``outcome``, "" until it is known."""
        return self.completion.result[1] if self.completion.result else ""

    @property
    def done(self) -> bool:
        """It moves the joints no more, also not behind its last point."""
        return self.completion.done

    @property
    def on_path(self) -> bool:
        """It follows its path or reached its end; a successor may continue it."""
        return self.completion.goes_on

    def cancel(self) -> None:
        """Request a controlled stop, which ends at standstill; no effect after the end."""
        self.completion.request(Outcome.CANCELED, "canceled by the client")

    def wait(self, timeout_s: float | None = None) -> bool:
        """Block until ``outcome`` is known; return False after ``timeout_s`` (None: no limit).

        That is at standstill, or when a last point with a velocity has been passed.
        """
        return self.completion.known.wait(timeout_s)

    def ticks(self, period_ns: int, clock: Clock) -> AbstractContextManager[Iterator[None]]:
        """Yield an iterator that ticks every ``period_ns`` on ``clock`` until ``outcome`` is known.

        Simulated time stands from a tick until the next one is asked for.
        """
        return ticks(self.completion.known, period_ns, clock)

    def progress(self) -> Progress:
        """Return the values of one control period: path at ``time_s`` and measurement."""
        return self._tracking.progress()

    def splice_state(self, time_ns: int) -> MotionState | None:
        """Return the commanded state at ``time_ns`` if it stays on its path until then.

        None where a successor has to wait for standstill.
        """
        return self._source.splice_state(time_ns) if self.on_path else None

    def begin(self) -> None:
        """Start: it was submitted and will run. Follower."""
        self._source.begin()

    def delay(self, by_ns: int) -> None:
        """Postpone its start: the source that it continues was slowed down meanwhile. Slot."""
        self._source.start_ns += by_ns

    def take_over(self, running: SetpointSource, advanced_ns: int) -> None:
        """Continue from the setpoint that the joints are reaching with ``running``. Slot."""
        self._source.take_over(running)
        self._advanced_ns = advanced_ns

    def sent(self, due_ns: int) -> None:
        """Note that ``setpoint`` was handed to the device, to be reached at ``due_ns``. Slot."""
        self._source.sent(due_ns)

    def advance(self, time_ns: int, period_ns: int, image: ProcessImage) -> bool:
        """Check the measured values of ``time_ns`` and compute the next setpoint.

        Returns False where the device computes it.
        """
        if self.completion.outcome is not None:
            return self._source.streams
        pause_ns, self._advanced_ns = time_ns - self._advanced_ns, time_ns
        self._observe(image, time_ns)
        self._check_drives(image, pause_ns)
        if self._state.phase in (Phase.RUNNING, Phase.ARRIVING):
            self._check_path(time_ns, pause_ns)
        if self._passage is not None and self._state.phase in (Phase.RUNNING, Phase.ARRIVING):
            self._pass_goal(self._passage, time_ns)
        due_ns = time_ns + period_ns
        match self._state.phase:
            case Phase.RUNNING | Phase.STOPPING:
                following = self._source.move(time_ns, due_ns, pause_ns, image)
                if following is not None:
                    self._state.enter(following, time_ns)
            case Phase.ARRIVING:
                self._source.hold(due_ns, period_ns)
                self._arrive(time_ns)
            case Phase.RESTING:
                self._source.hold(due_ns, period_ns)
                self._rest(time_ns, image)
        return self._source.streams

    def _observe(self, image: ProcessImage, time_ns: int) -> None:
        time_s = self._source.expect(time_ns, self._state.phase, image, self._tracking.desired)
        if self._history is not None and self._state.phase in (Phase.RUNNING, Phase.STOPPING):
            desired = self._tracking.desired
            self._history.add(time_ns, desired)
            time_s -= self.rate * self._history.recall(image.fresh_ns, desired)
        self._tracking.update(image.measured[:2, self.columns], time_s)

    def _check_drives(self, image: ProcessImage, pause_ns: int) -> None:
        """End with a fault when a drive does not follow, also during a stop."""
        if self._monitor.is_faulty(image) and not self.completion.is_fault:
            text = self._monitor.describe(image, self._source.time_s, pause_ns)
            self.completion.escalate(text)

    def _check_path(self, time_ns: int, pause_ns: int) -> None:
        """Check the path tolerance; begin to stop when an end is requested."""
        # Until a stall is recovered from, the joints are where it left them.
        stalled = pause_ns > STALL_S * NANOSECONDS or not self._source.on_path
        if self.ending is None and self._state.phase is Phase.RUNNING and not stalled:
            desired, measured = self._tracking.desired, self._tracking.measured
            violation = self._tolerances.check_path(
                self._source.time_s, desired[0], measured[0], desired[1], measured[1]
            )
            if violation is not None:
                self.completion.request(Outcome.PATH_TOLERANCE, str(violation))
        if self.ending is not None:
            self._state.enter(self._source.stop(time_ns), time_ns)

    def _pass_goal(self, passage: GoalPassage, time_ns: int) -> None:
        """Give the result when the last point is passed, at the latest at standstill."""
        if passage.update(self._tracking.progress().time_s, self._tracking.measured[0]):
            self._passage = None
            self.completion.announce(Outcome.SUCCEEDED, self._success_text())
        elif self._state.phase is Phase.ARRIVING:
            self.completion.request(Outcome.GOAL_TOLERANCE, str(passage.violation()))
            self._state.enter(Phase.RESTING, time_ns)

    def _arrive(self, time_ns: int) -> None:
        """Wait until the joints are within the goal tolerance."""
        over_s = self._state.age_s(time_ns)
        desired, measured = self._tracking.desired, self._tracking.measured
        violation = self._tolerances.check_goal(
            self.trajectory.duration_s + over_s, desired[0], measured[0], measured[1]
        )
        if self._state.settle(violation is None and self._source.on_path):
            self.completion.finish(Outcome.SUCCEEDED, self._success_text())
        elif violation and over_s > self._tolerances.goal_time_s:
            self.completion.request(Outcome.GOAL_TOLERANCE, str(violation))
            self._state.enter(Phase.RESTING, time_ns)

    def _rest(self, time_ns: int, image: ProcessImage) -> None:
        """Wait until the joints are at rest, then end as requested."""
        if self._source.is_stopping(time_ns, image):
            self._state.enter(Phase.RESTING, time_ns)
            return
        fast = np.abs(self._tracking.measured[1]) > self._stopped_velocity
        # The velocity of an offline drive is an old value.
        moving = bool((fast & ~image.offline[self._axes]).any())
        at_rest = self._state.settle(not moving and not self._source.is_active(image))
        ready = at_rest or self._state.age_s(time_ns) > REST_TIMEOUT_S
        if self.ending is None or not (ready or self._returning):
            return
        outcome, message = self.ending
        if self._returning or (outcome in TOLERANCES and not moving):
            # Once begun it ends, also when a joint that is free again moves.
            offset = self._tracking.measured[0] - image.position_command[self._axes]
            self._returning = self._source.return_command(time_ns, offset)
        if ready and not self._returning:
            self.completion.finish(outcome, f"{message}; joints still move" if moving else message)

    def _success_text(self) -> str:
        worst = int(np.argmax(self.max_error))
        goal_s = self.trajectory.goal_s
        passed = f"reached after {self.trajectory.duration_s:.3f} s"
        if goal_s is not None:
            passed = f"passed after {goal_s:.3f} s"
        return (
            f"goal {passed}; largest following error"
            f" {self.max_error[worst]:.4f} {self._limits.units[worst]}"
            f" ({self.trajectory.names[worst]})"
        )
