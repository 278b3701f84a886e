"""Execution of one trajectory by the control loop: phases, tolerances, outcome."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass

import numpy as np

from robotd.arrays import FloatArray, IntArray
from robotd.clock import NANOSECONDS, Clock
from robotd.clock.simulated import ticks
from robotd.control.completion import Outcome
from robotd.control.joint_source import STALL_S, JointSource, Phase
from robotd.control.joint_tracking import CommandHistory, GoalPassage, JointTracking, Progress
from robotd.control.source_slot import PREEMPTED
from robotd.device.process_image import ProcessImage
from robotd.errors import Unsupported
from robotd.motion import JointLimits, Tolerances, Trajectory

__all__ = ["PREEMPTED", "Outcome", "PlannedGoal", "Progress", "TrajectoryExecution"]

TOLERANCES = frozenset({Outcome.PATH_TOLERANCE, Outcome.GOAL_TOLERANCE})


@dataclass(frozen=True, eq=False)
class PlannedGoal:
    """Trajectory of m joints with the conditions of its execution.

    Attributes:
        axes: (m,) index of each joint's axis.
        stopped_velocity: (m,) rad/s or m/s below which a joint is at rest.
    """

    trajectory: Trajectory
    axes: IntArray
    limits: JointLimits
    tolerances: Tolerances
    stopped_velocity: FloatArray


class TrajectoryExecution(JointSource):
    """Execution of one trajectory, made by ``TrajectoryFollower.follow``.

    Advanced by the control loop, awaited by one worker. Any thread may call ``cancel``, ``wait``
    and ``progress``; the rest belongs to the control loop. A subclass moves the joints, and
    requests the end when it cannot continue.

    Args:
        start_ns: monotonic time of the trajectory's time 0.
        feedback_period_s: see ``AxisDriver``; the command of that time ago is compared with the
            measured values. 0: that of the present period.

    Attributes:
        time_s: trajectory time of ``setpoint``.
    """

    def __init__(self, goal: PlannedGoal, start_ns: int, *, feedback_period_s: float = 0.0) -> None:
        trajectory = goal.trajectory
        super().__init__(
            goal.limits,
            goal.axes,
            start_ns,
            np.vstack(trajectory.evaluate(np.zeros(1))),
            goal.stopped_velocity,
        )
        self.trajectory, self.time_s = trajectory, 0.0
        self._tolerances = goal.tolerances
        self._tracking = JointTracking(self.setpoint[:2])
        self._history = CommandHistory() if feedback_period_s > 0.0 else None
        goal_s = trajectory.goal_s
        self._passage = None if goal_s is None else GoalPassage(trajectory, goal_s, goal.tolerances)
        self._returning = False  # the command, to joints that did not follow it

    @property
    def max_error(self) -> FloatArray:
        """(m,) largest following error so far, rad or m."""
        return self._tracking.max_error

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

    def cancel(self) -> None:
        """Request a controlled stop, which ends at standstill; no effect after the end."""
        self.completion.request(Outcome.CANCELED, "canceled by the client")

    def override_speed(self, ratio: float) -> None:
        """Scale the rate of this trajectory, by a ramp, beside the speed of all motion. Any thread.

        ``ratio``: above 0, to 1.

        Raises Unsupported: the device interpolates the trajectory itself.
        """
        raise Unsupported("another speed of a running trajectory")

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

    def begin(self) -> None:
        """Start: it was submitted and will run. Follower."""

    def advance(self, time_ns: int, period_ns: int, image: ProcessImage) -> bool:
        """Check the measured values of ``time_ns`` and compute the next setpoint.

        Returns False where the device computes it.
        """
        if self.completion.outcome is not None:
            return self.streams
        pause_ns = self._begin_period(time_ns)
        desired = self._tracking.desired
        time_s = self._expect(time_ns, image, desired)
        if self._history is not None and self._phase in (Phase.RUNNING, Phase.STOPPING):
            self._history.add(time_ns, desired)
            time_s -= self.rate * self._history.recall(image.fresh_ns, desired)
        self._tracking.update(image.measured[:2, self.columns], time_s)
        self._check_drives(image, self.time_s, pause_ns)
        if self._phase in (Phase.RUNNING, Phase.ARRIVING):
            self._check_path(time_ns, pause_ns)
        if self._passage is not None and self._phase in (Phase.RUNNING, Phase.ARRIVING):
            self._pass_goal(self._passage, time_ns)
        due_ns = time_ns + period_ns
        match self._phase:
            case Phase.RUNNING | Phase.STOPPING:
                following = self._move(time_ns, due_ns, pause_ns, image)
                if following is not None:
                    self._enter(following, time_ns)
            case Phase.ARRIVING:
                self._hold(due_ns, period_ns)
                self._arrive(time_ns)
            case Phase.RESTING:
                self._hold(due_ns, period_ns)
                self._rest(time_ns, image)
        return self.streams

    def _check_path(self, time_ns: int, pause_ns: int) -> None:
        """Check the path tolerance; begin to stop when an end is requested."""
        # Until a stall is recovered from, the joints are where it left them.
        stalled = pause_ns > STALL_S * NANOSECONDS or self._deviates
        if self.completion.requested is None and self._phase is Phase.RUNNING and not stalled:
            desired, measured = self._tracking.desired, self._tracking.measured
            violation = self._tolerances.path.check(
                self.time_s, desired[0], measured[0], desired[1], measured[1]
            )
            if violation is not None:
                self.completion.request(Outcome.PATH_TOLERANCE, str(violation))
        if self.completion.requested is not None:
            self._enter(self._stop(time_ns), time_ns)

    def _pass_goal(self, passage: GoalPassage, time_ns: int) -> None:
        """Give the result when the last point is passed, at the latest at standstill."""
        if passage.update(self._tracking.progress().time_s, self._tracking.measured[0]):
            self._passage = None
            self.completion.announce(Outcome.SUCCEEDED, self._success_text())
        elif self._phase is Phase.ARRIVING:
            self.completion.request(Outcome.GOAL_TOLERANCE, str(passage.violation()))
            self._enter(Phase.RESTING, time_ns)

    def _arrive(self, time_ns: int) -> None:
        """Wait until the joints are within the goal tolerance."""
        over_s = self._phase_age_s(time_ns)
        desired, measured = self._tracking.desired, self._tracking.measured
        violation = self._tolerances.check_goal(
            self.trajectory.duration_s + over_s, desired[0], measured[0], measured[1]
        )
        if self._settle(violation is None and not self._deviates):
            self.completion.finish(Outcome.SUCCEEDED, self._success_text())
        elif violation and over_s > self._tolerances.goal_time_s:
            self.completion.request(Outcome.GOAL_TOLERANCE, str(violation))
            self._enter(Phase.RESTING, time_ns)

    def _rest(self, time_ns: int, image: ProcessImage) -> None:
        """Wait until the joints are at rest, then end as requested."""
        if self._is_stopping(time_ns, image):
            self._enter(Phase.RESTING, time_ns)
            return
        moving = self._moves(image)
        ready = self._is_settled(time_ns, at_rest=not moving and not self._is_active(image))
        if self.completion.requested is None or not (ready or self._returning):
            return
        if self._returning or (self.completion.requested[0] in TOLERANCES and not moving):
            # Once begun it ends, also when a joint that is free again moves.
            offset = self._tracking.measured[0] - image.position_command[self.columns]
            self._returning = self._return_command(time_ns, offset)
        if ready and not self._returning:
            self._finish(moving=moving)

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

    @property
    def _deviates(self) -> bool:
        """The setpoint is off the path, after a stall."""
        return self.stall_recovery is not None and self.stall_recovery.active

    @abstractmethod
    def _expect(self, time_ns: int, image: ProcessImage, out: FloatArray) -> float:
        """Write the command that the device has at ``time_ns`` into ``out`` (2, m).

        Returns its trajectory time.
        """

    @abstractmethod
    def _move(self, time_ns: int, due_ns: int, pause_ns: int, image: ProcessImage) -> Phase | None:
        """Continue on the path, or along the stop, to ``due_ns``.

        Args:
            due_ns: of the setpoint.
            pause_ns: since the period before.

        Returns the next phase, None while it moves.
        """

    def _hold(self, due_ns: int, period_ns: int) -> None:
        """Stay at the end of the path; a device may do so by itself."""

    @abstractmethod
    def _stop(self, time_ns: int) -> Phase:
        """Begin to stop; return the phase in which that is done."""

    def _is_stopping(self, time_ns: int, image: ProcessImage) -> bool:
        """Return True while the joints may still be slowing down after the stop."""
        return False

    def _is_active(self, image: ProcessImage) -> bool:
        """Return True while the device reports motion by itself."""
        return False

    @abstractmethod
    def _return_command(self, time_ns: int, offset: FloatArray) -> bool:
        """Move the command by ``offset`` (m,), to joints that did not follow; False once there.

        In each period until then. The first call counts: the measured positions minus the commands
        of the device, which may differ from the setpoints.
        """
