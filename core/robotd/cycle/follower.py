"""From a requested trajectory to its execution: plan, claim the axes, hand over to the cycle."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial

import numpy as np

from robotd.clock import NANOSECONDS, Clock
from robotd.cycle.execution import Execution
from robotd.cycle.on_device import DeviceExecution
from robotd.cycle.streamer import Streamer
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
)

OWNER = "follow_joint_trajectory"
LEAD_S = 0.03  # planning time granted to a goal that takes over from a running one
STOP_TIMEOUT_S = 10.0  # the longest controlled stop that is waited for


class TrajectoryFollower:
    """Executes trajectories of a robot's joints, one at a time; a newer one takes over.

    Any worker thread may call; concurrent goals are planned one after the other.

    Args:
        on_device: gets trajectories whole, where ``axes.trajectories_on_device``; None streams
            them.
    """

    def __init__(
        self,
        axes: Axes,
        streamer: Streamer,
        descriptor: RobotDescriptor,
        clock: Clock,
        on_device: AxisDriver | None = None,
    ) -> None:
        joints = descriptor.joints
        self.settings = descriptor.trajectory
        self.limits = JointLimits(
            tuple(joint.name for joint in joints),
            np.array([joint.lower_rad for joint in joints]),
            np.array([joint.upper_rad for joint in joints]),
            np.array([joint.velocity_rad_s for joint in joints]),
            np.array([joint.acceleration_rad_s2 for joint in joints]),
        )
        self._axes = axes
        self._streamer = streamer
        self._clock = clock
        self._execution = (
            partial(DeviceExecution, on_device, descriptor.trajectory.max_points)
            if on_device
            else Execution
        )
        self._joint_axes = np.array([joint.axis for joint in joints], np.int64)
        self._claim = ExitStack()
        self._active = 0
        self._lock = threading.RLock()

    def tolerances(
        self,
        path: Iterable[JointTolerance] = (),
        goal: Iterable[JointTolerance] = (),
        goal_time_s: float = 0.0,
    ) -> Tolerances:
        """The descriptor's tolerances with those of a goal message laid over them.

        In each value 0 means the descriptor's, -1 no limit. Raises TrajectoryRefused.
        """
        return Tolerances.of_goal(self.limits.names, self.settings, path, goal, goal_time_s)

    @contextmanager
    def follow(
        self,
        request: TrajectoryRequest,
        tolerances: Tolerances | None = None,
        start_ns: int | None = None,
    ) -> Iterator[Execution]:
        """Start a trajectory; the block watches it. Leaving the block cancels what still runs.

        Args:
            request: points in any order of joints.
            tolerances: for the path and the goal; None: the descriptor's.
            start_ns: monotonic time at which the trajectory's time 0 is; None: now.

        Raises:
            TrajectoryRefused: the request is not acceptable; nothing moved, and what ran
                before runs on.
            NotReady: a joint cannot be commanded now.
        """
        execution = self._start(request, tolerances or self.tolerances(), start_ns)
        try:
            yield execution
        finally:
            execution.cancel()
            execution.wait(STOP_TIMEOUT_S)
            self._release()

    def stop(self) -> None:
        """Stop what runs in a controlled way and wait for standstill. Nothing runs: no effect."""
        active = self._streamer.active
        for execution in active:
            execution.cancel()
        for execution in active:
            execution.wait(STOP_TIMEOUT_S)

    def _start(
        self, request: TrajectoryRequest, tolerances: Tolerances, start_ns: int | None
    ) -> Execution:
        with self._lock:
            trajectory, splice_ns = self._plan(request, start_ns)
            self._acquire()
            execution = self._execution(
                trajectory,
                self._joint_axes,
                self.limits,
                tolerances,
                splice_ns or max(self._clock.now_ns(), start_ns or 0),
                self.settings.stopped_velocity_rad_s,
            )
            self._streamer.submit(execution, self._joint_axes)
            return execution

    def _plan(
        self, request: TrajectoryRequest, start_ns: int | None
    ) -> tuple[Trajectory, int | None]:
        """The trajectory, and when it must take over from a running one (None: none runs)."""
        lead_s = LEAD_S
        while (running := self._streamer.running) is not None and not running.done:
            splice_ns = max(self._clock.now_ns() + round(lead_s * NANOSECONDS), start_ns or 0)
            if isinstance(running, DeviceExecution):
                # It must stop first; a request that would be refused anyway leaves it alone.
                plan(request, self.limits, self.settings, self._rest_state())
                running.preempt()
            state = running.splice_state(splice_ns)
            if state is None:
                if not running.wait(STOP_TIMEOUT_S):
                    raise NotReady("the joints did not come to rest after the last trajectory")
                continue
            trajectory = plan(request, self.limits, self.settings, state)
            if self._clock.now_ns() < splice_ns:
                return trajectory, splice_ns
            lead_s *= 2.0
        return plan(request, self.limits, self.settings, self._rest_state()), None

    def _rest_state(self) -> MotionState:
        """Where the command stands: planning from the measured position would be a jump."""
        for axis in self._joint_axes:
            if reason := self._axes.refusal(int(axis), CommandMode.POSITION, OWNER):
                raise NotReady(reason)
        return MotionState.at_rest(self._axes.image.position_command[self._joint_axes])

    def _acquire(self) -> None:
        if self._active == 0:
            axes = [int(axis) for axis in self._joint_axes]
            self._claim.enter_context(self._axes.claimed(OWNER, axes))
        self._active += 1

    def _release(self) -> None:
        with self._lock:
            self._active -= 1
            if self._active == 0:
                self._streamer.release()
                self._claim.close()
