"""Setpoint source that follows the commands of a stream while they arrive."""

from __future__ import annotations

import threading
from collections import deque

import numpy as np

from robotd.arrays import FloatArray, IntArray
from robotd.clock import NANOSECONDS
from robotd.control.completion import Outcome
from robotd.control.joint_source import JointSource, Phase
from robotd.control.source_slot import SetpointSource
from robotd.control.stall_recovery import StallRecovery
from robotd.control.stream_setpoints import StreamCommand, StreamMode, StreamSetpoints
from robotd.device.axes import Axes
from robotd.device.motion_limits import MotionLimits
from robotd.device.process_image import ProcessImage
from robotd.motion import JointLimits, MotionState

MAX_QUEUED_COMMANDS = 16  # commands in one period; older ones are dropped
MAX_ACCELERATION_SHARE_AFTER_STALL = 2.0  # of the limits; a drive cannot follow any


class StreamMotion(JointSource):
    """Motion of m joints towards the commands that ``put`` receives.

    Without a command for ``timeout_s`` the joints slow to rest; the next command continues, unless
    ``ends_when_silent``. It ends when a client requests it, at standstill, or with a fault.

    Args:
        robot: axes of the robot; the stream ends at a speed of 0, because its targets cannot wait.
        axes: (m,) index of each joint's axis.
        start_ns: due time of the first setpoint, at the earliest.
        mode: interpolation between position targets.
        timeout_s: age of the last command at which the joints slow to rest.
        stopped_velocity: (m,) rad/s or m/s below which a joint is at rest.
        ends_when_silent: it ends when the joints are at rest after ``timeout_s``.

    Attributes:
        timeout_ns: age of the last command at which the joints slow to rest.
        timeouts: number of times that the joints slowed to rest without a command.
    """

    stall_recovery: StallRecovery

    def __init__(
        self,
        robot: Axes,
        axes: IntArray,
        state: MotionState,
        start_ns: int,
        *,
        limits: JointLimits,
        mode: StreamMode,
        timeout_s: float,
        period_s: float,
        stopped_velocity: FloatArray,
        motion_limits: MotionLimits,
        ends_when_silent: bool,
    ) -> None:
        setpoint = np.array([state.position, state.velocity, state.acceleration])
        super().__init__(limits, axes, start_ns, setpoint, stopped_velocity)
        self.mode, self.timeouts = mode, 0
        self.stall_recovery = StallRecovery(
            setpoint[:2], start_ns, limits, robot.underrun, robot.stream_buffer_s
        )
        self._speed = robot.speed
        self._setpoints = StreamSetpoints(limits, mode, period_s, motion_limits)
        self._setpoints.reset(state)
        self.timeout_ns = round(timeout_s * NANOSECONDS)
        self._timeout_s, self._ends_when_silent = timeout_s, ends_when_silent
        self._commands: deque[StreamCommand] = deque(maxlen=MAX_QUEUED_COMMANDS)
        self._commanded_ns = start_ns
        self._silent = False
        self._due_ns = 0
        self._settled_until_ns = 0
        self._lock = threading.Lock()  # of the setpoints, against ``splice_state``

    def put(self, command: StreamCommand) -> None:
        """Follow ``command`` from the next period on; never blocks. Any thread."""
        self._commands.append(command)

    def splice_state(self, time_ns: int) -> MotionState | None:
        """Return the state at ``time_ns``, until which commands wait. Any thread."""
        with self._lock:
            if not self.completion.goes_on:
                return None
            self._settled_until_ns = max(self._settled_until_ns, time_ns)  # another may wait
            if not self._due_ns:
                return MotionState.at_rest(self.setpoint[0])
            self._setpoints.settle()
            return self._setpoints.after((time_ns - self._due_ns) / NANOSECONDS)

    def end_splice(self) -> None:
        self._settled_until_ns = 0

    def take_over(self, running: SetpointSource, advanced_ns: int, delay_ns: int) -> None:
        """Continue from the setpoint of ``running``, made in the period ``advanced_ns``."""
        self._continue(running, advanced_ns, delay_ns)
        self._setpoints.reset(MotionState(*running.setpoint))
        if running.stall_recovery is not None:
            self.stall_recovery = running.stall_recovery
            self.stall_recovery.accept()

    def advance(self, time_ns: int, period_ns: int, image: ProcessImage) -> bool:
        """Compute the setpoint for ``time_ns + period_ns``; holds it after the end."""
        if self.completion.done:
            return True
        with self._lock:
            self._due_ns = time_ns + period_ns
            seconds = (time_ns - self.start_ns) / NANOSECONDS
            self._check_drives(image, seconds, self._begin_period(time_ns))
            if not self._speed.scale:
                self.completion.request(Outcome.STOPPED, f"motion is {self._speed.text}")
            reached = self.stall_recovery.resume(time_ns, period_ns / NANOSECONDS)
            if reached is not None:
                position, velocity = reached
                state = MotionState(position, velocity, np.zeros_like(position))
                self._setpoints.reset(state, MAX_ACCELERATION_SHARE_AFTER_STALL)
                self.stall_recovery.left_plan = self._due_ns <= self._settled_until_ns
            if self._phase is Phase.RUNNING:
                self._take_commands(time_ns)
            self.setpoint[:] = self._setpoints.advance(self._due_ns)
            if self._setpoints.failure:
                self.completion.request(Outcome.FAULT, self._setpoints.failure)
            if self._phase is not Phase.RUNNING and self._setpoints.at_rest:
                if self._phase is Phase.STOPPING:
                    self._enter(Phase.RESTING, time_ns)
                self._end_at_rest(time_ns, image)
        return True

    def sent(self, due_ns: int) -> None:
        self.stall_recovery.sent(self.setpoint[:2], due_ns)

    def _take_commands(self, time_ns: int) -> None:
        """Take what has arrived; slow to rest when nothing has, or an end was requested."""
        if self.completion.requested is None and self._due_ns > self._settled_until_ns:
            while self._commands:
                command = self._commands.popleft()
                self._setpoints.take(command)
                self._commanded_ns, self._silent = command.time_ns, False
            if time_ns - self._commanded_ns > self.timeout_ns and not self._silent:
                self._silent = True
                self.timeouts += 1
                self._setpoints.stop()
                if self._ends_when_silent:
                    self.completion.request(
                        Outcome.SUCCEEDED, f"no command for {self._timeout_s:g} s"
                    )
        if self.completion.requested is not None:
            self._setpoints.stop()
            self._enter(Phase.STOPPING, time_ns)
