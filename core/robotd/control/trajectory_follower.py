"""Plans requested trajectories, claims the axes, and submits executions to the mixer."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS, Clock, wait_until
from robotd.clock.simulated import held
from robotd.control.setpoint_mixer import SetpointMixer
from robotd.control.trajectory_execution import TrajectoryExecution
from robotd.descriptor import RobotDescriptor
from robotd.device.axes import Axes
from robotd.device.drivers import AxisDriver
from robotd.device.state import CommandMode
from robotd.errors import NotReady
from robotd.motion import (
    JointLimits,
    JointTolerance,
    MotionState,
    Tolerances,
    Trajectory,
    TrajectoryRequest,
    plan,
    spline_points,
)

OWNER = "follow_joint_trajectory"
REPLAN_S = 0.5  # age of the joint positions that a client may have planned from
MAX_RECENT = 50  # trajectories within that time
LEAD_S = 0.03  # planning time of a goal that takes over from a running one
STOP_TIMEOUT_S = 10.0  # of a controlled stop
MOVED_RAD = 1e-6  # change of a command that counts as motion
PLANNINGS = 8  # of one goal, each with twice the lead of the one before


Planner = Callable[[MotionState], Trajectory]


@dataclass(frozen=True)
class _Planned:
    """Planned trajectory and the monotonic time of its time 0."""

    trajectory: Trajectory
    start_ns: int


class TrajectoryFollower:
    """Executes trajectories of a robot's joints, one at a time; a newer one takes over.

    Any worker thread may call; concurrent goals are planned one after the other.

    Args:
        on_device: driver that interpolates trajectories itself, where
            ``axes.trajectories_on_device``; None: they are streamed.
    """

    def __init__(
        self,
        axes: Axes,
        mixer: SetpointMixer,
        descriptor: RobotDescriptor,
        clock: Clock,
        on_device: AxisDriver | None = None,
    ) -> None:
        joints = descriptor.joints
        self.settings = descriptor.trajectory
        self.limits = JointLimits(
            tuple(joint.name for joint in joints),
            np.array([joint.lower for joint in joints]),
            np.array([joint.upper for joint in joints]),
            np.array([joint.velocity for joint in joints]),
            np.array([joint.acceleration for joint in joints]),
            tuple(joint.unit for joint in joints),
        )
        self._axes = axes
        self._mixer = mixer
        self._clock = clock
        self._on_device = on_device
        self._execution = (
            partial(TrajectoryExecution.on_device, on_device)
            if on_device
            else partial(
                TrajectoryExecution.streamed,
                underrun=axes.underrun,
                buffer_s=axes.stream_buffer_s,
            )
        )
        self._joint_axes = np.array([joint.axis for joint in joints], np.int64)
        self._claim = ExitStack()
        self._active = 0
        self._recent: deque[TrajectoryExecution] = deque(maxlen=MAX_RECENT)
        self._lock = threading.RLock()

    def tolerances(
        self,
        path: Iterable[JointTolerance] = (),
        goal: Iterable[JointTolerance] = (),
        goal_time_s: float = 0.0,
    ) -> Tolerances:
        """Return the descriptor's tolerances, overridden by those of a goal message.

        In each value 0 means the descriptor's, -1 no limit. Raises TrajectoryRejected.
        """
        return Tolerances.of_goal(self.limits, self.settings, path, goal, goal_time_s)

    @contextmanager
    def follow(
        self,
        request: TrajectoryRequest,
        tolerances: Tolerances | None = None,
        start_ns: int | None = None,
    ) -> Iterator[TrajectoryExecution]:
        """Start a trajectory as a context; leaving it cancels the execution.

        Args:
            request: points in any order of joints.
            tolerances: for the path and the goal; None: the descriptor's.
            start_ns: monotonic time at which the trajectory's time 0 is; None: now.

        Raises:
            TrajectoryRejected: the request is not acceptable; a running trajectory continues.
            NotReady: a joint cannot be commanded now.
        """
        execution = self._start(request, tolerances or self.tolerances(), start_ns)
        try:
            yield execution
        finally:
            execution.cancel()
            self._await_end(execution, STOP_TIMEOUT_S)
            self._release()

    def stop(self, timeout_s: float = STOP_TIMEOUT_S) -> None:
        """Stop the active executions along their paths and wait for standstill.

        After ``timeout_s`` it returns while the joints may still move.
        """
        active = self._mixer.active
        for execution in active:
            execution.cancel()
        for execution in active:
            self._await_end(execution, timeout_s)

    def _start(
        self, request: TrajectoryRequest, tolerances: Tolerances, start_ns: int | None
    ) -> TrajectoryExecution:
        with self._lock, held(self._clock):  # simulated time must not outrun planning
            try:
                execution = self._submit(request, tolerances, start_ns or 0)
            except BaseException:
                if self._active == 0:
                    self._claim.close()
                raise
            self._active += 1
            return execution

    def _submit(
        self, request: TrajectoryRequest, tolerances: Tolerances, start_ns: int
    ) -> TrajectoryExecution:
        """Plan and submit; repeat while the running trajectory has changed meanwhile."""
        lead_s, recent_path = LEAD_S, self._recent_path(start_ns)

        def planner(state: MotionState) -> Trajectory:
            return plan(request, self.limits, self.settings, state, recent_path)

        for _ in range(PLANNINGS):
            running = self._mixer.running
            if running is None or running.done:
                after, planned = None, self._plan_from_rest(planner, running, start_ns)
            else:
                after, planned = running, self._plan_splice(planner, running, start_ns, lead_s)
                lead_s *= 2.0
            if planned is None:
                continue
            execution = self._execution(
                planned.trajectory,
                self._joint_axes,
                self.limits,
                tolerances,
                planned.start_ns,
                self.limits.stopped_velocity(self.settings),
            )
            if self._mixer.submit(execution, after):
                self._recent.append(execution)
                execution.begin()
                return execution
        raise NotReady(f"the joints did not go on as planned for, {PLANNINGS} times in a row")

    def _plan_splice(
        self, planner: Planner, running: TrajectoryExecution, start_ns: int, lead_s: float
    ) -> _Planned | None:
        """Plan from the path of ``running``; None after its standstill when it left the path."""
        splice_ns = max(self._clock.now_ns() + round(lead_s * NANOSECONDS), start_ns)
        state = running.splice_state(splice_ns)
        if state is not None:
            return _Planned(planner(state), splice_ns)
        if self._on_device is not None:
            # It has to stop first, but not for a request that would be rejected anyway.
            trajectory = planner(MotionState.at_rest(self._command()))
            spline_points(trajectory, self._on_device.max_trajectory_points)
            running.preempt()
        if not self._await_end(running, STOP_TIMEOUT_S):
            raise NotReady("the joints did not come to rest after the last trajectory")
        return None

    def _plan_from_rest(
        self, planner: Planner, running: TrajectoryExecution | None, start_ns: int
    ) -> _Planned | None:
        """Plan from standstill and claim the axes; None when they have moved meanwhile."""
        state = self._rest_state()
        trajectory = planner(state)
        if not self._mixer.release_after(running):
            return None
        # Claim again: after a fault the device has taken axes out of the stream.
        self._claim.close()
        self._claim.enter_context(self._axes.claimed(OWNER, self._joint_axes.tolist()))
        if (np.abs(self._command() - state.position) > MOVED_RAD).any():
            return None
        earliest_ns = max(self._mixer.next_start_ns, self._clock.now_ns())
        return _Planned(trajectory, max(earliest_ns, start_ns))

    def _recent_path(self, start_ns: int) -> FloatArray:
        """Return (w, m) commanded positions of the last and the next ``REPLAN_S``.

        A client that replans in motion does not know the joint positions at the time when its
        goal takes over. It may start from any of these positions.
        """
        now_ns = max(self._clock.now_ns(), start_ns)
        first_ns = now_ns - round(REPLAN_S * NANOSECONDS)
        while len(self._recent) > 1 and self._recent[1].start_ns <= first_ns:
            self._recent.popleft()
        moving = bool(self._recent) and not self._recent[-1].done and self._recent[-1].on_path
        seconds = (2.0 if moving else 1.0) * REPLAN_S
        tolerance = self.limits.start_tolerance(self.settings)
        step_s = float((tolerance / self.limits.velocity).min())
        times_s = np.linspace(0.0, seconds, int(np.ceil(seconds / step_s)) + 1)
        path = np.tile(self._command(), (len(times_s), 1))
        for execution in self._recent:
            path_s = times_s + (first_ns - execution.start_ns) / NANOSECONDS
            end_s = execution.trajectory.duration_s
            if not execution.on_path:  # stopped, or being stopped
                end_s = execution.progress().time_s
            covered = (path_s >= 0.0) & (path_s <= end_s)
            path[covered] = execution.trajectory.evaluate(path_s[covered])[0]
        return path

    def _rest_state(self) -> MotionState:
        """Return the commanded position; a plan from the measured one would jump."""
        for axis in self._joint_axes.tolist():
            if error := self._axes.rejection(axis, CommandMode.POSITION, OWNER):
                raise error
        return MotionState.at_rest(self._command())

    def _await_end(self, execution: TrajectoryExecution, timeout_s: float) -> bool:
        return wait_until(lambda: execution.done, timeout_s, self._clock)

    def _command(self) -> FloatArray:
        return self._axes.image.position_command[self._joint_axes]

    def _release(self) -> None:
        with self._lock:
            self._active -= 1
            if self._active == 0:
                self._mixer.release()
                self._claim.close()
