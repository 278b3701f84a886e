"""Execution of one trajectory by the control loop: phases, tolerances, outcome."""

from __future__ import annotations

from abc import abstractmethod
from collections import deque
from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass

import numpy as np

from robotd.arrays import FloatArray, IntArray
from robotd.clock import NANOSECONDS, Clock
from robotd.clock.simulated import ticks
from robotd.control.loop.setpoint_source import Outcome
from robotd.control.sources.contact import (
    Contact,
    ContactLimits,
    ContactWatch,
    WrenchLimits,
    WrenchWatch,
)
from robotd.control.sources.joint_source import (
    REST_TIMEOUT_S,
    STALL_S,
    JointSource,
    SourcePhase,
)
from robotd.control.sources.trajectory_extension import Extension
from robotd.device.process_image import ProcessImage
from robotd.errors import Unsupported
from robotd.motion import JointLimits, RateBounds, Tolerances, Trajectory, Violation

# Joints that could not follow, whose command returns to them: nothing is pressed on.
HELD_UP = frozenset({Outcome.PATH_TOLERANCE, Outcome.GOAL_TOLERANCE, Outcome.CONTACT})
MIN_ERROR = 0.005  # rad or m; less is lag and sag of a healthy drive, and stays
PEAK_VELOCITY, PEAK_ACCELERATION = 1.875, 5.7735  # of 10u³ - 15u⁴ + 6u⁵, for 1 in 1 s


@dataclass(frozen=True, eq=False)
class PlannedGoal:
    """Trajectory of m joints with the conditions of its execution.

    Attributes:
        axes: (m,) index of each joint's axis.
        stopped_velocity: (m,) rad/s or m/s below which a joint is at rest.
        rate_bounds: of what the joints move; None: changes of speed keep their accelerations only.
        contact: torques or wrench at which the motion ends; None: it ends at its last point only.
    """

    trajectory: Trajectory
    axes: IntArray
    limits: JointLimits
    tolerances: Tolerances
    stopped_velocity: FloatArray
    rate_bounds: RateBounds | None = None
    contact: ContactLimits | WrenchLimits | None = None


class TrajectoryExecution(JointSource):
    """Execution of one trajectory, made by ``TrajectoryFollower.follow``.

    Advanced by the control loop, awaited by one worker. Any thread may call ``cancel``, ``wait``
    and ``progress``; the rest belongs to the control loop. A subclass moves the joints, and
    requests the end when it cannot continue.

    Args:
        start_ns: monotonic time of the trajectory's time 0.
        feedback_period_s, response_s: see ``AxisDriver``; the command of that time ago is compared
            with the measured values. 0: that of the present period.

    Attributes:
        time_s: trajectory time of ``setpoint``.
    """

    def __init__(
        self,
        goal: PlannedGoal,
        start_ns: int,
        *,
        feedback_period_s: float = 0.0,
        response_s: float = 0.0,
    ) -> None:
        trajectory = goal.trajectory
        super().__init__(
            goal.limits,
            goal.axes,
            start_ns,
            np.vstack(trajectory.evaluate(np.zeros(1))),
            goal.stopped_velocity,
            response_s,
        )
        self.trajectory, self.time_s = trajectory, 0.0
        self._tolerances = goal.tolerances
        self._tracking = JointTracking(self.setpoint[:2])
        self._history = CommandHistory() if feedback_period_s + response_s > 0.0 else None
        goal_s = trajectory.goal_s
        self._passage = None if goal_s is None else GoalPassage(trajectory, goal_s, goal.tolerances)
        self._contact = None if goal.contact is None else goal.contact.watch(goal.limits)
        self._returning = False  # the command, to joints that did not follow it

    @property
    def max_error(self) -> FloatArray:
        """(m,) largest following error so far, rad or m."""
        return self._tracking.max_error

    @property
    def contact(self) -> Contact | None:
        """The contact that has ended it; None: there was none."""
        return None if self._contact is None else self._contact.contact

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
        """True once it moves the joints no more, also after its last point."""
        return self.completion.done

    def cancel(self) -> None:
        """Request a controlled stop, which ends at standstill; no effect after the end."""
        self.completion.request(Outcome.CANCELED, "canceled by the client")

    def override_speed(self, ratio: float) -> None:
        """Scale this trajectory's rate, by a ramp, besides the speed of all motion. Any thread.

        ``ratio``: above 0, to 1.

        Raises Unsupported: the device interpolates the trajectory itself.
        """
        raise Unsupported("another speed of a running trajectory")

    def extend(self, extension: Extension) -> None:
        """Continue on a longer trajectory; its ``accepted`` is known later. One worker thread.

        Raises Unsupported: the device interpolates the trajectory itself.
        """
        raise Unsupported("a longer trajectory while it runs")

    def wait(self, timeout_s: float | None = None) -> bool:
        """Block until ``outcome`` is known; return False after ``timeout_s`` (None: no limit).

        That is at standstill, or when a last point with a velocity has been passed.
        """
        return self.completion.known.wait(timeout_s)

    def ticks(self, period_ns: int, clock: Clock) -> AbstractContextManager[Iterator[None]]:
        """Yield an iterator that ticks every ``period_ns`` on ``clock`` until ``outcome`` is known.

        Simulated time is held from a tick until the next one is asked for.
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
        if self._history is not None and self._phase in (SourcePhase.RUNNING, SourcePhase.STOPPING):
            self._history.add(time_ns, desired)
            time_s -= self.rate * self._history.recall(
                image.fresh_ns - round(self._response_s * NANOSECONDS), desired
            )
        self._tracking.update(image.measured[:2, self.columns], time_s)
        self._check_drives(image, self.time_s, pause_ns)
        if self._phase in (SourcePhase.RUNNING, SourcePhase.ARRIVING):
            if self._contact is not None and self.completion.requested is None:
                self._look_for_contact(self._contact, image)
            self._check_path(time_ns, pause_ns)
        if self._passage is not None and self._phase in (SourcePhase.RUNNING, SourcePhase.ARRIVING):
            self._pass_goal(self._passage, time_ns)
        due_ns = time_ns + period_ns
        match self._phase:
            case SourcePhase.RUNNING | SourcePhase.STOPPING:
                following = self._move(time_ns, due_ns, pause_ns, image)
                if following is not None:
                    self._enter(following, time_ns)
            case SourcePhase.ARRIVING:
                self._hold(due_ns, period_ns, image)
                self._arrive(time_ns, image)
            case SourcePhase.RESTING:
                self._hold(due_ns, period_ns, image)
                self._rest(time_ns, image)
        return self.streams

    def _look_for_contact(self, watch: ContactWatch | WrenchWatch, image: ProcessImage) -> None:
        """Request the end at a contact, and where torque or wrench are not known."""
        if reason := watch.look(image, self.columns):
            outcome = Outcome.FAULT if watch.contact is None else Outcome.CONTACT
            self.completion.request(outcome, f"{reason}, at {self.time_s:.3f} s")

    def _check_path(self, time_ns: int, pause_ns: int) -> None:
        """Check the path tolerance; begin to stop when an end is requested."""
        # Until a stall is recovered from, the joints are where it left them.
        stalled = pause_ns > STALL_S * NANOSECONDS or self._deviates
        if self.completion.requested is None and self._phase is SourcePhase.RUNNING and not stalled:
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
        elif self._phase is SourcePhase.ARRIVING:
            self.completion.request(Outcome.GOAL_TOLERANCE, str(passage.violation()))
            self._enter(SourcePhase.RESTING, time_ns)

    def _arrive(self, time_ns: int, image: ProcessImage) -> None:
        """Wait until the last point is commanded, and the joints are within the goal tolerance."""
        over_s = self._phase_age_s(time_ns)
        desired, measured = self._tracking.desired, self._tracking.measured
        violation = self._tolerances.check_goal(
            self.trajectory.duration_s + over_s, desired[0], measured[0], measured[1]
        )
        commanded = over_s > REST_TIMEOUT_S or self._is_commanded(image)
        if self._settle(violation is None and not self._deviates and commanded):
            self.completion.finish(Outcome.SUCCEEDED, self._success_text())
        elif violation and over_s > self._tolerances.goal_time_s:
            self.completion.request(Outcome.GOAL_TOLERANCE, str(violation))
            self._enter(SourcePhase.RESTING, time_ns)

    def _rest(self, time_ns: int, image: ProcessImage) -> None:
        """Wait until the joints are at rest, then end as requested."""
        if self._is_stopping(time_ns, image):
            self._enter(SourcePhase.RESTING, time_ns)
            return
        moving = self._moves(image)
        ready = self._is_settled(time_ns, at_rest=not moving and not self._is_active(image))
        if self.completion.requested is None or not (ready or self._returning):
            return
        if self._returning or (self.completion.requested[0] in HELD_UP and not moving):
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
            + (f"; no contact: {self._contact.most}" if self._contact is not None else "")
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
    def _move(
        self, time_ns: int, due_ns: int, pause_ns: int, image: ProcessImage
    ) -> SourcePhase | None:
        """Continue on the path, or along the stop, to ``due_ns``.

        Args:
            due_ns: of the setpoint.
            pause_ns: since the period before.

        Returns the next phase, None while it moves.
        """

    def _hold(self, due_ns: int, period_ns: int, image: ProcessImage) -> None:
        """Stay at the end of the path; a device may do so by itself."""

    def _is_commanded(self, image: ProcessImage) -> bool:
        """Return True when the device asks its drives for the last point."""
        return True

    @abstractmethod
    def _stop(self, time_ns: int) -> SourcePhase:
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


@dataclass(frozen=True)
class Progress:
    """Progress of an execution; arrays (m,) in the order of the trajectory's names."""

    time_s: float
    desired_position: FloatArray
    desired_velocity: FloatArray
    actual_position: FloatArray
    actual_velocity: FloatArray


class JointTracking:
    """Desired and measured motion of m joints in the present period.

    ``progress`` may be called by any thread, the rest belongs to the control loop.

    ``setpoint``: (2, m) position and velocity at the start.

    Attributes:
        desired, measured: (2, m) position and velocity of the present period.
    """

    def __init__(self, setpoint: FloatArray) -> None:
        self._motion: FloatArray = np.stack([setpoint, setpoint])
        self.desired, self.measured = self._motion
        self._max_error = [0.0] * setpoint.shape[1]
        # Replaced as a whole: another thread sees the values of one period.
        self._snapshot = (0.0, self._motion.copy())

    @property
    def max_error(self) -> FloatArray:
        """(m,) largest following error so far, rad or m."""
        return np.array(self._max_error)

    def update(self, measured: FloatArray, time_s: float) -> None:
        """Take the ``measured`` (2, m) of a period, whose ``desired`` is written already.

        The errors in plain floats: NumPy would take three functions that run nowhere else in a
        period.
        """
        self.measured[:] = measured
        worst, position = self._max_error, self.measured[0].tolist()
        for joint, wanted in enumerate(self.desired[0].tolist()):
            # NaN leaves the maximum as it is.
            worst[joint] = max(worst[joint], abs(wanted - position[joint]))
        self._snapshot = time_s, self._motion.copy()

    def progress(self) -> Progress:
        """Return the values of one control period: path at ``time_s`` and measurement."""
        time_s, (desired, measured) = self._snapshot
        return Progress(time_s, desired[0], desired[1], measured[0], measured[1])


class CommandHistory:
    """Commands of m joints by the time at which the device had them. Control-loop thread.

    A measured value is compared with the command of its own time: at 3 rad/s a value that is 10 ms
    old would otherwise look like a following error of 0.03 rad.
    """

    def __init__(self) -> None:
        self._commands: deque[tuple[int, FloatArray]] = deque()

    def add(self, time_ns: int, command: FloatArray) -> None:
        """Append the ``command`` (2, m) position and velocity of ``time_ns``, which increases."""
        self._commands.append((time_ns, command.copy()))

    def recall(self, time_ns: int, out: FloatArray) -> float:
        """Write the command of ``time_ns`` into ``out`` (2, m); return its age in seconds.

        Commands before it are forgotten. Between two commands it is interpolated. Before the
        first one the joints moved with its velocity; after the last one it is the last one.
        """
        commands, newest_ns = self._commands, self._commands[-1][0]
        while len(commands) > 2 and commands[1][0] <= time_ns:
            commands.popleft()
        first_ns, first = commands[0]
        if time_ns <= first_ns or len(commands) == 1:
            early_s = max(0, first_ns - time_ns) / NANOSECONDS
            out[:] = first
            out[0] -= early_s * first[1]
        else:
            second_ns, second = commands[1]
            share = min(1.0, (time_ns - first_ns) / (second_ns - first_ns))
            out[:] = first
            out += share * (second - first)
        return max(0, newest_ns - time_ns) / NANOSECONDS


class GoalPassage:
    """Finds out when every joint has passed the last point of its goal. Control-loop thread.

    A joint passes it when its measured position is within the goal tolerance of the point, or
    crosses it between two periods, at the time of the point or later: joints that follow with
    different lags pass one after the other.
    """

    def __init__(self, trajectory: Trajectory, goal_s: float, tolerances: Tolerances) -> None:
        self._goal_s, self._tolerances = goal_s, tolerances
        self._point = trajectory.state_at(goal_s).position
        self._closest: FloatArray = np.full_like(self._point, np.inf)
        self._before: FloatArray = np.full_like(self._point, np.nan)

    def update(self, time_s: float, measured: FloatArray) -> bool:
        """Take positions (m,) measured at trajectory time ``time_s``; True: all have passed."""
        error = measured - self._point
        if time_s >= self._goal_s:
            distance = np.where(error * self._before <= 0.0, 0.0, np.abs(error))
            np.fmin(self._closest, distance, self._closest)
        self._before = error
        return time_s >= self._goal_s and self.violation() is None

    def violation(self) -> Violation | None:
        """Return the joint that came least close to the point; None when all have passed."""
        rest = np.zeros_like(self._point)
        return self._tolerances.check_goal(self._goal_s, self._closest, rest, rest)


class CommandReturn:
    """Move of the command alone, from standstill to standstill, within the joints' limits.

    The joint rests at its measured position; the command moves there along a quintic polynomial.

    Args:
        command: (m,) position command, rad or m.
        offset: (m,) from the command to the joints at rest, rad or m.

    Attributes:
        start_ns: when it begins; later after a pause.
        duration_s: of the move.
    """

    def __init__(
        self, command: FloatArray, offset: FloatArray, limits: JointLimits, start_ns: int
    ) -> None:
        self.start_ns = start_ns
        self._ended = False
        self._start = command.copy()
        self._offset: FloatArray = np.where(np.abs(offset) > MIN_ERROR, offset, 0.0)
        size = np.abs(self._offset)
        by_velocity = PEAK_VELOCITY * size / limits.velocity
        by_acceleration = np.sqrt(PEAK_ACCELERATION * size / limits.acceleration)
        self.duration_s = float(np.maximum(by_velocity, by_acceleration).max())

    def points(self, count: int) -> tuple[FloatArray, FloatArray]:
        """Return times (count,) in s from 0, and positions (count, m) of the command."""
        u = np.linspace(0.0, 1.0, count)
        share = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
        return u * self.duration_s, self._start + share[:, None] * self._offset

    def sample(self, time_ns: int, command: FloatArray) -> bool:
        """Write the motion at ``time_ns`` into ``command`` (3, m).

        Returns False when the end had been written before.
        """
        if self._ended:
            return False
        time_s = (time_ns - self.start_ns) / NANOSECONDS
        u = min(time_s / self.duration_s, 1.0) if self.duration_s else 1.0
        command[0] = self._start + self._offset * (u**3 * (10.0 - 15.0 * u + 6.0 * u**2))
        rate = 1.0 / self.duration_s if self.duration_s else 0.0
        command[1] = self._offset * (30.0 * u**2 * (1.0 - u) ** 2 * rate)
        command[2] = self._offset * (60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) * rate**2)
        self._ended = u >= 1.0
        return True
