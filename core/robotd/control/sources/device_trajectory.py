"""Trajectory that the device interpolates: sent whole, and monitored each control period.

The core decides on the outcome (tolerances, faults, standstill) and the device computes the
setpoints, so the desired motion is the command that the device reports.
"""

from __future__ import annotations

import threading

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS
from robotd.control.loop.setpoint_source import Outcome
from robotd.control.sources.joint_source import REST_TIMEOUT_S, SourcePhase
from robotd.control.sources.trajectory_execution import (
    CommandReturn,
    PlannedGoal,
    TrajectoryExecution,
)
from robotd.device.axis_stops import AxisStops
from robotd.device.drivers import AxisDriver
from robotd.device.process_image import ProcessImage
from robotd.device.state import STREAMING, Operation
from robotd.errors import DeviceTimeout, RobotdError
from robotd.log import get_logger
from robotd.motion import JointLimits, Trajectory, spline_points

log = get_logger("trajectory")

MIN_PATH = 1e-6  # rad or m; a shorter path is not sent to the device
COMPLETION_TIMEOUT_S = 2.0  # time after the planned end in which the device may still move
END_TOLERANCE = 1e-3  # rad or m, between the device's last command and the last point
EARLY_S, EARLY_SHARE = 0.05, 0.02  # of the duration: an arrival before that is a fault
IDLE_PERIODS = 5  # in which an idle device has to show its last command and completion
STOP_SAMPLES = 64  # of the path during a stop
STOP_TIME_RATIO = 1.1  # ratio of the stop times that are tried
MIN_STOP_S, MAX_STOP_S = 1e-3, 30.0
RETURN_POINTS = 21  # of the path on which the command returns to joints that did not follow


class DeviceTrajectory(TrajectoryExecution):
    """Motion by a device with the capability TRAJECTORIES_ON_DEVICE.

    Its thread makes the calls that may block: ``follow`` when the control loop begins to monitor,
    and once more to return the command to joints that did not follow it. ``AxisStops`` stops the
    device when the execution ends without success, until it is at rest. An arrival needs the
    device's command at the last point, not before its time. A fault ends it when the device does
    not follow.

    Args:
        driver: of the axes.
        given_up, stops: of ``Axes``.
        goal, start_ns: see ``TrajectoryExecution``; nothing moves before ``start_ns``.
    """

    streams = False

    def __init__(
        self,
        driver: AxisDriver,
        given_up: set[int],
        stops: AxisStops,
        goal: PlannedGoal,
        start_ns: int,
    ) -> None:
        super().__init__(goal, start_ns)
        self._driver, self._given_up, self._stops = driver, given_up, stops
        self.completion.on_end = self._wake
        self._times_s, self._points = spline_points(self.trajectory, driver.max_trajectory_points)
        self._has_path = bool(np.ptp(self._points, axis=0).max() >= MIN_PATH)
        self._end_point = self.trajectory.state_at(self.trajectory.duration_s).position
        self._monitored = threading.Event()
        self._ended = threading.Event()
        self._monitor_from_ns = start_ns
        self._started = self._seen_moving = self._stop_sent = False
        self._idle_periods = 0
        self._not_moving_ns = start_ns  # the last time at which the device had not begun
        self._stop_ns = start_ns
        self._stop_s = 0.0
        self._at_rest = threading.Event()  # the return was requested, or the execution has ended
        self._return: CommandReturn | None = None
        self._return_sent = False

    def begin(self) -> None:
        threading.Thread(target=self._run, name="robotd-trajectory", daemon=True).start()

    def _expect(self, time_ns: int, image: ProcessImage, out: FloatArray) -> float:
        if time_ns >= self._monitor_from_ns:
            self._monitored.set()
        if self._phase is SourcePhase.ARRIVING:
            self.setpoint[0], self.setpoint[1] = self._end_point, 0.0
        else:
            self.setpoint[:2] = image.commands[:, self.columns]
        out[:] = self.setpoint[:2]
        running = self._phase is SourcePhase.RUNNING
        return (time_ns - self.start_ns) / NANOSECONDS if running else self.time_s

    def _move(
        self, time_ns: int, due_ns: int, pause_ns: int, image: ProcessImage
    ) -> SourcePhase | None:
        moving = bool((image.operation[self._axes] == STREAMING).any())
        if moving and not self._seen_moving:
            self._seen_moving, self._not_moving_ns = True, time_ns - pause_ns
        if not (self._started or self._seen_moving):
            self.start_ns = time_ns
        self.time_s = (time_ns - self.start_ns) / NANOSECONDS
        over_s = self.time_s - self.trajectory.duration_s
        if moving and over_s > COMPLETION_TIMEOUT_S:
            self._fault(f"the device is still moving {over_s:.1f} s after its time")
        elif not moving and (self._seen_moving or over_s > 0.0):
            return self._judge_end(time_ns, image)
        return None

    def _stop(self, time_ns: int) -> SourcePhase:
        """Let the thread stop the device."""
        self._wake()
        return SourcePhase.RESTING

    def _is_stopping(self, time_ns: int, image: ProcessImage) -> bool:
        """Return True until the stop was sent and is confirmed, within its time."""
        if not self._stop_sent:  # a standstill before the stop proves nothing
            self._stop_ns = time_ns
            return True
        since_s = (time_ns - self._stop_ns) / NANOSECONDS
        if self._stops.is_pending(self._axes.tolist()):
            return since_s < max(self._stop_s, REST_TIMEOUT_S)
        return self._is_active(image) and since_s < self._stop_s

    def _is_active(self, image: ProcessImage) -> bool:
        """Return True while an axis is not idle, even if it is slow."""
        return bool((image.operation[self._axes] != Operation.IDLE).any())

    def _return_command(self, time_ns: int, offset: FloatArray) -> bool:
        """Let the device move its command by ``offset`` (m,); return False once it is there."""
        if self._return is None:
            self._return = CommandReturn(self.setpoint[0], offset, self._limits, time_ns)
            if self._return.duration_s > 0.0:
                self._at_rest.set()
        if self._return.duration_s == 0.0:
            return False
        if not self._return_sent:
            self._return.start_ns = time_ns
        return (time_ns - self._return.start_ns) / NANOSECONDS <= self._return.duration_s

    def _finish(self, *, moving: bool) -> None:
        super()._finish(moving=moving or self._stops.is_pending(self._axes.tolist()))

    def _wake(self) -> None:
        self._monitored.set()
        self._ended.set()
        if self.completion.outcome is not None:
            self._at_rest.set()

    def _fault(self, message: str) -> None:
        self.completion.request(Outcome.FAULT, message)

    def _judge_end(self, time_ns: int, image: ProcessImage) -> SourcePhase | None:
        """Distinguish an arrival from a stop and from another path."""
        stopped = self._is_active(image)
        off = np.abs(self.setpoint[0] - self._end_point)
        joint = int(np.argmax(off))
        took_s = (time_ns - self._not_moving_ns) / NANOSECONDS  # upper bound
        if not stopped and off[joint] <= END_TOLERANCE:
            planned_s = self.trajectory.duration_s
            if not self._seen_moving or took_s >= planned_s * (1.0 - EARLY_SHARE) - EARLY_S:
                return SourcePhase.ARRIVING
            self._fault(f"the device ended a trajectory of {planned_s:.3f} s after {took_s:.3f} s")
            return None
        self._idle_periods += 1
        if not stopped and self._idle_periods < IDLE_PERIODS:
            return None
        if not stopped and image.motion_complete[self._axes].all():
            self._fault(self._other_end_text(joint, took_s))
        else:
            self._fault(f"the device stopped at {self.time_s:.3f} s by itself")
        return None

    def _other_end_text(self, joint: int, took_s: float) -> str:
        unit = self._limits.units[joint]
        return (
            f"{self.trajectory.names[joint]}: the device ended the trajectory at"
            f" {self.setpoint[0, joint]:.4f} {unit} after {took_s:.3f} s, its last point is"
            f" {self._end_point[joint]:.4f} {unit} at {self.trajectory.duration_s:.3f} s"
        )

    def _run(self) -> None:
        self._monitored.wait()
        try:
            if not self.completion.requested and self.completion.outcome is None:
                if self._has_path:
                    self._follow(self._times_s, self._points)
                self._started = True
                self._ended.wait()
        except RobotdError as error:
            self._fault(str(error))
        if self.completion.outcome is not Outcome.SUCCEEDED:
            self._stop_device()
        self._stop_sent = True
        self._at_rest.wait()
        if self._return is not None and self.completion.outcome is None:
            self._return_device(self._return)
            self._return_sent = True

    def _follow(self, times_s: FloatArray, points: FloatArray) -> None:
        axes = self._axes.tolist()
        try:
            self._driver.follow(axes, times_s, points)
        except DeviceTimeout:  # the device may begin it all the same
            self._given_up.update(axes)
            raise

    def _stop_device(self) -> None:
        self._stop_s = stop_time(self.trajectory, self.time_s, self._limits)
        self._stops.request(self._axes.tolist(), self._stop_s)

    def _return_device(self, path: CommandReturn) -> None:
        try:
            self._follow(*path.points(RETURN_POINTS))
        except RobotdError as error:
            log.error("the command was not returned to the joints", reason=str(error))


def stop_time(trajectory: Trajectory, from_s: float, limits: JointLimits) -> float:
    """Return the shortest stop along the path that the joints' acceleration limits allow, s.

    For a device whose path rate r falls evenly from 1 to 0 within the time T: the joints
    accelerate with q''(s)·r² - q'(s)/T. Where the plan itself exceeds a limit, the stop may
    come as close to it as the plan did.

    Args:
        trajectory: runs at rate 1 up to the stop.
        from_s: trajectory time at which the stop begins; clipped to the trajectory.
        limits: of the same joints; their accelerations count.
    """
    from_s = min(max(from_s, 0.0), trajectory.duration_s)
    velocity = np.abs(trajectory.state_at(from_s).velocity)
    time_s = max(float((velocity / limits.acceleration).max()), MIN_STOP_S)
    while time_s < MAX_STOP_S:
        since_s = np.linspace(0.0, time_s, STOP_SAMPLES)
        rate = (1.0 - since_s / time_s)[:, None]
        path_s = np.minimum(from_s + since_s - since_s**2 / (2.0 * time_s), trajectory.duration_s)
        _, speed, planned = trajectory.evaluate(path_s)
        allowed = np.maximum(limits.acceleration, np.abs(planned).max(axis=0))
        if (np.abs(planned * rate**2 - speed / time_s) <= allowed * STOP_TIME_RATIO).all():
            break
        time_s *= STOP_TIME_RATIO
    return time_s
