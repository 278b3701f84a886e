"""Plans requested trajectories and starts their executions."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import partial

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS, wait_until
from robotd.clock.simulated import untimed
from robotd.control.groups.descriptor_limits import joint_limits, trajectory_rules
from robotd.control.groups.joint_motion import JointMotion
from robotd.control.loop.rearming import CommandSource, Rearming
from robotd.control.loop.setpoint_source import Outcome
from robotd.control.sources.contact import ContactLimits, WrenchLimits
from robotd.control.sources.device_trajectory import DeviceTrajectory
from robotd.control.sources.streamed_trajectory import StreamedTrajectory
from robotd.control.sources.trajectory_execution import (
    PlannedGoal,
    TrajectoryExecution,
)
from robotd.control.sources.trajectory_extension import Extension
from robotd.descriptor import RobotDescriptor
from robotd.device.axes import Axes
from robotd.device.drivers import AxisDriver
from robotd.device.motion_limits import MotionLimits, PathCheck
from robotd.device.state import CommandMode
from robotd.errors import RobotdError
from robotd.events import EventKind, Level
from robotd.motion import (
    JointTolerance,
    MotionState,
    Tolerances,
    Trajectory,
    TrajectoryRequest,
    plan,
)
from robotd.motion.rejection import RejectionCode, TrajectoryRejected, reject

MAX_REPLANNING_AGE_S = 0.5  # age of the joint positions that a client may have planned from
MAX_RECENT_TRAJECTORIES = 50  # trajectories within that time
SUBJECT = "goal"  # of events
BAD = frozenset({Outcome.FAULT, Outcome.PATH_TOLERANCE, Outcome.GOAL_TOLERANCE})
COMPARED = 50  # places at which a longer trajectory is compared with the running one
SAME_POSITION = 1e-7  # rad or m
MAX_SAMPLES = 10_000  # of their path: one each 0.1 ms, more often than any client gets feedback


class TrajectoryFollower:
    """Executes trajectories of a joint group, one at a time; a newer one takes over.

    Any worker thread may call; concurrent goals are planned one after the other.

    ``on_device``: driver that interpolates trajectories itself, where
    ``axes.trajectories_on_device``; None: they are streamed.
    """

    def __init__(
        self,
        motion: JointMotion,
        axes: Axes,
        descriptor: RobotDescriptor,
        motion_limits: MotionLimits,
        on_device: AxisDriver | None = None,
    ) -> None:
        joints = descriptor.joints
        self.limits = joint_limits(joints, axes.limits, axes.device_limits)
        self.rules = trajectory_rules(descriptor.trajectory, self.limits.units)
        self._motion, self._clock, self._events = motion, axes.clock, axes.events
        self._speed, self._motion_limits = axes.speed, motion_limits
        self._takeover = descriptor.stream.takeover
        self._joint_axes = np.array([joint.axis for joint in joints], np.int64)
        self._on_device, self._axes = on_device, axes
        self._checked: tuple[PathCheck, Trajectory] | None = (
            None  # path that passed last, and by what
        )
        self._recent: deque[TrajectoryExecution] = deque(maxlen=MAX_RECENT_TRAJECTORIES)

    def source(self, name: str, rearming: Rearming) -> CommandSource:
        """Return a source of trajectories that has to begin anew after motion was rejected.

        A goal of an action needs none: each is a new command.
        """
        axes = self._joint_axes.tolist()
        modes = [CommandMode.POSITION] * len(axes)
        neutral = "a trajectory without points"
        return CommandSource(
            rearming, name, axes, modes, timeout_s=0.0, neutral=neutral, follows_speed=True
        )

    def set_default_tolerances(
        self, path: Sequence[float], goal: Sequence[float], goal_time_s: float
    ) -> None:
        """Replace the descriptor's tolerances, for goals that begin from now on. Executor thread.

        Args:
            path, goal: of each joint, rad or m; inf: not checked.
            goal_time_s: time after the end to reach the goal; inf: without an end.
        """
        self.rules = replace(
            self.rules,
            path_tolerance=np.array(path),
            goal_tolerance=np.array(goal),
            goal_time_s=goal_time_s,
        )

    def allow_end_velocity(self, allowed: bool) -> None:
        """Replace ``allow_nonzero_velocity_at_trajectory_end`` for the next goals, likewise."""
        self.rules = replace(self.rules, allow_end_velocity=allowed)

    def tolerances(
        self,
        path: Iterable[JointTolerance] = (),
        goal: Iterable[JointTolerance] = (),
        goal_time_s: float = 0.0,
    ) -> Tolerances:
        """Return the default tolerances, overridden by those of a goal message.

        In each value 0 means the default, -1 no limit. Raises TrajectoryRejected.
        """
        return Tolerances(self.limits, self.rules, path, goal, goal_time_s)

    @contextmanager
    def follow(
        self,
        request: TrajectoryRequest,
        tolerances: Tolerances | None = None,
        start_ns: int | None = None,
        ticket: int = 0,
        contact: ContactLimits | WrenchLimits | None = None,
    ) -> Iterator[TrajectoryExecution]:
        """Start a trajectory as a context; leaving it cancels the execution.

        Args:
            request: points in any order of joints.
            tolerances: for the path and the goal; None: the defaults.
            start_ns: monotonic time at which the trajectory's time 0 is; None: now.
            ticket: of ``JointMotion.ticket``, for requests that workers take up in any order.
            contact: torques, or a wrench, at which it ends by the ordinary stop, with
                ``Outcome.CONTACT``; None: it ends at its last point only.

        Raises:
            TrajectoryRejected: the request is not acceptable; a running trajectory continues.
            NotReady: a joint cannot be commanded now, a newer request was started already, or what
                ``contact`` compares is not known, or beyond its limit already.
        """
        limits, allowed = self.limits, tolerances or self.tolerances()

        def planned(state: MotionState) -> Callable[[int], TrajectoryExecution]:
            trajectory = plan(request, limits, self.rules, state, recent_path)
            if self._on_device is not None and trajectory.goal_s is not None:
                raise reject(
                    f"the last point, at {trajectory.goal_s:.3f} s, has a velocity: a device"
                    " that interpolates trajectories itself ends them at rest"
                )
            self._check_path(trajectory)
            goal = PlannedGoal(
                trajectory,
                self._joint_axes,
                limits,
                allowed,
                self.rules.stopped_velocity,
                request.rate_bounds,
                contact,
            )
            if self._on_device is not None:
                return partial(
                    DeviceTrajectory, self._on_device, self._axes.given_up, self._axes.stops, goal
                )
            return partial(StreamedTrajectory, self._axes, self._motion_limits, goal)

        with ExitStack() as claim:
            try:
                if contact is not None:
                    contact.require_ready(limits, self._axes.image.copy(), self._joint_axes)
                with self._motion.lock, untimed(self._clock):
                    if start_ns is not None and len(request.times_s):
                        delay_s = (start_ns - self._clock.now_ns()) / NANOSECONDS
                        check_start_time(delay_s, float(request.times_s[-1]))
                    recent_path = self._recent_path(start_ns or 0)
                    execution = self._motion.start(
                        planned, start_ns or 0, takeover=self._takeover, ticket=ticket
                    )
                    claim.callback(self._motion.release, execution)
                    self._recent.append(execution)
                    execution.begin()
            except RobotdError as error:
                data = {"outcome": "rejected", "joints": list(request.joint_names)}
                text = f"goal rejected: {error}"
                self._events.add(EventKind.GOAL, SUBJECT, text, level=Level.WARNING, data=data)
                raise
            self._note_goal(request, execution)
            try:
                yield execution
            finally:
                claim.close()
                self._note_result(execution)

    def extend(
        self, execution: TrajectoryExecution, request: TrajectoryRequest, same_s: float
    ) -> bool:
        """Continue an execution on a longer trajectory, without a stop. Worker thread.

        Args:
            request: from the start of the running trajectory on.
            same_s: trajectory time up to which both are the same.

        Returns False where it is too late: the execution goes on as it was.

        Raises TrajectoryRejected: the longer one is not acceptable; Unsupported: the device
        interpolates trajectories itself.
        """
        running = execution.trajectory
        start = MotionState.at_rest(running.evaluate(np.zeros(1))[0][0])
        longer = plan(request, self.limits, self.rules, start)
        times_s = np.linspace(min(max(execution.time_s, 0.0), same_s), same_s, COMPARED)
        apart = np.abs(longer.evaluate(times_s)[0] - running.evaluate(times_s)[0]).max()
        if apart > SAME_POSITION:
            raise reject(f"the longer trajectory leaves the running one by {apart:.2g} rad or m")
        self._check_path(longer)
        extension = Extension(longer, same_s, request.rate_bounds)
        execution.extend(extension)
        while extension.accepted is None and not execution.done:
            wait_until(lambda: extension.accepted is not None or execution.done, 1.0, self._clock)
        if extension.accepted:
            self._note_goal(request, execution, "extended")
        return bool(extension.accepted)

    def check(self, request: TrajectoryRequest, start: FloatArray | None = None) -> None:
        """Check a trajectory from rest at ``start`` (m,); nothing moves.

        ``start`` None: where the joints are commanded to be. Raises TrajectoryRejected.
        """
        state = MotionState.at_rest(self._motion.command() if start is None else start)
        self._check_path(plan(request, self.limits, self.rules, state))

    def state_at(self, time_ns: int) -> MotionState | None:
        """Return the commanded state at monotonic ``time_ns``; rest where nothing moves.

        None: a stream or a stop decides where the joints will be. Any thread.
        """
        newest = self._recent[-1] if self._recent else None
        if newest is not None and not newest.done:
            return newest.splice_state(time_ns)
        return None if self._motion.moving else MotionState.at_rest(self._motion.command())

    @property
    def rate(self) -> float:
        """Ratio of motion time to real time, during its ramps too. Any thread.

        That of the running trajectory; without one, the speed in force.
        """
        running = self._motion.running
        if isinstance(running, TrajectoryExecution) and not running.done:
            return running.rate
        return self._speed.scale

    def _note_goal(
        self, request: TrajectoryRequest, execution: TrajectoryExecution, outcome: str = "accepted"
    ) -> None:
        """Note an accepted or extended goal with the points as the client gave them."""
        rows = {
            "positions": request.positions,
            "velocities": request.velocities,
            "accelerations": request.accelerations,
        }
        data = {
            "outcome": outcome,
            "id": id(execution),
            "start_ns": execution.start_ns,
            "joints": list(request.joint_names),
            "times_s": request.times_s,
            **{name: given for name, given in rows.items() if given is not None},
        }
        count = len(request.times_s)
        duration_s = float(request.times_s[-1]) if count else 0.0
        text = f"goal of {count} point{'s' if count != 1 else ''} over {duration_s:.3f} s"
        self._events.add(EventKind.GOAL, SUBJECT, text, data=data)

    def _note_result(self, execution: TrajectoryExecution) -> None:
        outcome, completion = execution.outcome or Outcome.FAULT, execution.completion
        text = f"goal {outcome.name.lower()}: {execution.message}"
        if completion.outcome not in (outcome, Outcome.PREEMPTED, None):
            text = f"{text}; after its last point: {completion.message}"
        data = {"outcome": outcome.name.lower(), "id": id(execution)}
        level = Level.INFO if BAD.isdisjoint({outcome, completion.outcome}) else Level.ERROR
        self._events.add(EventKind.RESULT, SUBJECT, text, level=level, data=data)

    def _check_path(self, trajectory: Trajectory) -> None:
        """Check a path once: planning is repeated where it has taken too long."""
        check_path = self._motion_limits.check_path
        if check_path is None:
            return
        passed_by, passed = self._checked or (None, None)
        same = passed_by == check_path and all(
            np.array_equal(getattr(passed, part), getattr(trajectory, part))
            for part in ("breaks", "coefficients")
        )
        if not same:
            check_path(trajectory)
            self._checked = check_path, trajectory

    def _recent_path(self, start_ns: int) -> FloatArray:
        """Return (w, m) commanded positions of the last and the next ``MAX_REPLANNING_AGE_S``.

        A client that replans in motion does not know the joint positions at the time when its
        goal takes over. It may start from any of these positions.
        """
        now_ns = max(self._clock.now_ns(), start_ns)
        first_ns = now_ns - round(MAX_REPLANNING_AGE_S * NANOSECONDS)
        while len(self._recent) > 1 and self._recent[1].start_ns <= first_ns:
            self._recent.popleft()
        newest = self._recent[-1].completion if self._recent else None
        moving = newest is not None and not newest.done and newest.goes_on
        seconds = (2.0 if moving else 1.0) * MAX_REPLANNING_AGE_S
        # As dense as the fastest joint needs, but a velocity limit may be any number.
        steps = self.limits.velocity * seconds / self.rules.start_tolerance
        needed = float(steps.max(initial=1.0))
        times_s = np.linspace(0.0, seconds, int(np.ceil(min(needed, MAX_SAMPLES))) + 1)
        path = np.tile(self._motion.command(), (len(times_s), 1))
        for execution in self._recent:
            path_s = times_s + (first_ns - execution.start_ns) / NANOSECONDS
            end_s = execution.trajectory.duration_s
            if not execution.completion.goes_on:  # stopped, or being stopped
                end_s = execution.progress().time_s
            covered = (path_s >= 0.0) & (path_s <= end_s)
            path[covered] = execution.trajectory.evaluate(path_s[covered])[0]
        return path


def check_start_time(delay_s: float, duration_s: float) -> None:
    """Check the start time of a trajectory: any in the future, none at which it is over by now.

    Args:
        delay_s: the start time minus now.
        duration_s: duration of the trajectory.

    Raises TrajectoryRejected: ``OLD_HEADER_TIMESTAMP``.
    """
    if delay_s + duration_s < 0.0:
        raise TrajectoryRejected(
            RejectionCode.OLD_HEADER_TIMESTAMP,
            f"the trajectory of {duration_s:.3f} s should have begun {-delay_s:.3f} s ago: "
            f"it is over",
        )
