"""A trajectory that the device interpolates: handed over whole, watched by the cycle.

The core keeps the verdict (tolerances, faults, standstill) and the device the setpoints, so
what the joints are asked for is what the device reports, not what the core would compute.
"""

from __future__ import annotations

import threading

import numpy as np

from robotd.arrays import IntArray
from robotd.clock import NANOSECONDS
from robotd.control.trajectory_execution import Outcome, Phase, TrajectoryExecution
from robotd.device.drivers import AxisDriver
from robotd.device.process_image import ProcessImage
from robotd.device.state import Operation
from robotd.errors import RobotdError
from robotd.log import get_logger
from robotd.motion import JointLimits, MotionState, Tolerances, Trajectory, spline_points

log = get_logger("trajectory")

MIN_PATH = 1e-6  # rad or m; a shorter path is not handed to the device
OVERTIME_S = 2.0  # how long after its time the device may still be on its way
END_TOLERANCE = 1e-3  # rad or m, between the device's last command and the last point
EARLY_S, EARLY_SHARE = 0.05, 0.02  # of the duration: an arrival before that is a fault
IDLE_PERIODS = 5  # an idle device gets these to show its last command and completion
STOP_SAMPLES = 64  # of the path during a stop
STOP_STEP = 1.1  # ratio of the stop times that are tried
MIN_STOP_S, MAX_STOP_S = 1e-3, 30.0


class DeviceExecution(TrajectoryExecution):
    """As ``TrajectoryExecution``, for a device with the capability TRAJECTORIES_ON_DEVICE.

    Its own thread makes the two calls that may block, ``follow`` and ``stop_trajectory``: the
    first when the cycle begins to watch, the second whenever it ends in another way than
    arriving. Success needs command and measured position at the last point, not before its time.

    Args:
        driver: the axes; the others are those of ``TrajectoryExecution``.
    """

    streams = False

    def __init__(
        self,
        driver: AxisDriver,
        trajectory: Trajectory,
        axes: IntArray,
        limits: JointLimits,
        tolerances: Tolerances,
        start_ns: int,
        stopped_velocity: float,
    ) -> None:
        super().__init__(trajectory, axes, limits, tolerances, start_ns, stopped_velocity)
        self._start_ns = start_ns
        self._driver = driver
        self._times_s, self._points = spline_points(trajectory, driver.max_trajectory_points)
        self._still = bool(np.ptp(self._points, axis=0).max() < MIN_PATH)
        self._watched = threading.Event()
        self._ended = threading.Event()
        self._end_point = trajectory.state_at(trajectory.duration_s).position
        self._started = self._seen_moving = self._stop_sent = False
        self._idle_periods = 0
        self._not_moving_ns = start_ns  # the last time at which the device had not begun
        self._stop_s = 0.0

    def begin(self) -> None:
        threading.Thread(target=self._conduct, name="robotd-trajectory", daemon=True).start()

    def preempt(self) -> None:
        """A new goal waits: stop, and end as PREEMPTED. Any thread."""
        self._end(Outcome.PREEMPTED, "preempted by a new goal")

    def splice_state(self, time_ns: int) -> MotionState | None:
        """None: the device takes no other trajectory before this one has ended."""
        return None

    def advance(self, time_ns: int, period_ns: int, image: ProcessImage) -> None:
        if time_ns >= self._start_ns:
            self._watched.set()
        super().advance(time_ns, period_ns, image)

    def finish(self, outcome: Outcome, message: str) -> None:
        super().finish(outcome, message)
        self._watched.set()
        self._ended.set()

    def _end(self, outcome: Outcome, message: str) -> None:
        super()._end(outcome, message)
        self._watched.set()
        self._ended.set()

    def _observe(self, image: ProcessImage, time_ns: int) -> None:
        if self._phase is Phase.ARRIVING:
            self.position[:], self.velocity[:] = self._end_point, 0.0
        else:
            self.setpoint[:] = image.commands[:, self.columns]
        super()._observe(image, time_ns)

    def _expect(self, time_ns: int) -> None:
        self._aim[:] = self.setpoint

    def _hold(self, due_ns: int, period_ns: int) -> None:
        """The device holds by itself."""

    def _begin_stop(self, time_ns: int) -> None:
        self._watched.set()
        self._ended.set()
        self._enter(Phase.RESTING, time_ns)

    def _obeyed(self, image: ProcessImage) -> bool:
        return True  # ``_move_on`` tells an arrival from a stop

    def _move_on(self, due_ns: int, time_ns: int, image: ProcessImage) -> None:
        moving = bool((image.operation[self._axes] == Operation.STREAM).any())
        if moving and not self._seen_moving:
            self._seen_moving, self._not_moving_ns = True, time_ns - self._pause_ns
        if not (self._started or self._seen_moving):
            self.start_ns = time_ns
        self._time_s = (time_ns - self.start_ns) / NANOSECONDS
        over_s = self._time_s - self.trajectory.duration_s
        if moving and over_s > OVERTIME_S:
            self._end(Outcome.FAULT, f"the device is still moving {over_s:.1f} s after its time")
        elif not moving and (self._seen_moving or over_s > 0.0):
            self._judge_end(time_ns, image)

    def _judge_end(self, time_ns: int, image: ProcessImage) -> None:
        """Tell an arrival from a stop and from a device that took another path."""
        stopped = (image.operation[self._axes] != Operation.IDLE).any()
        off = np.abs(self.position - self._end_point)
        joint = int(np.argmax(off))
        took_s = (time_ns - self._not_moving_ns) / NANOSECONDS  # at the most
        expected_s = self.trajectory.duration_s
        if not stopped and off[joint] <= END_TOLERANCE:
            if self._seen_moving and took_s < expected_s * (1.0 - EARLY_SHARE) - EARLY_S:
                self._end(
                    Outcome.FAULT,
                    f"the device ended a trajectory of {expected_s:.3f} s after {took_s:.3f} s",
                )
            else:
                self._enter(Phase.ARRIVING, time_ns)
            return
        self._idle_periods += 1
        if not stopped and self._idle_periods < IDLE_PERIODS:
            return
        if not stopped and image.motion_complete[self._axes].all():
            unit = self._limits.units[joint]
            self._end(
                Outcome.FAULT,
                f"{self.trajectory.names[joint]}: the device ended the trajectory at"
                f" {self.position[joint]:.4f} {unit} after {took_s:.3f} s, its last point is"
                f" {self._end_point[joint]:.4f} {unit} at {expected_s:.3f} s",
            )
        else:
            self._end(Outcome.FAULT, f"the device stopped at {self._time_s:.3f} s by itself")

    def _rest(self, time_ns: int, image: ProcessImage) -> None:
        stopping_s = (time_ns - self._stop_ns) / NANOSECONDS
        if not self._stop_sent:  # a standstill before the stop proves nothing
            self._stop_ns = time_ns
            self._enter(Phase.RESTING, time_ns)
            return
        if (image.operation[self._axes] != Operation.IDLE).any():
            self._settled_periods = 0  # at the end of a stop the device is slow, and not done
            if stopping_s < self._stop_s:
                self._enter(Phase.RESTING, time_ns)
                return
        super()._rest(time_ns, image)

    def _conduct(self) -> None:
        self._watched.wait()
        try:
            if not self.ending and not self.done:
                if not self._still:
                    self._driver.follow(self._axes.tolist(), self._times_s, self._points)
                self._started = True
                self._ended.wait()
        except RobotdError as error:
            self._end(Outcome.FAULT, str(error))
        if self.outcome is not Outcome.SUCCEEDED:
            try:
                self._stop_s = stop_time(self.trajectory, self._time_s, self._limits)
                self._driver.stop_trajectory(self._axes.tolist(), self._stop_s)
            except RobotdError as error:
                log.error("stopping a trajectory failed", reason=str(error))
        self._stop_sent = True


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
        if (np.abs(planned * rate**2 - speed / time_s) <= allowed * STOP_STEP).all():
            break
        time_s *= STOP_STEP
    return time_s
