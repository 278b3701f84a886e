"""Odometry of a mobile base, tracked by the control loop."""

from __future__ import annotations

import math
import threading

from robotd.clock import NANOSECONDS
from robotd.device.process_image import ProcessImage
from robotd.log import get_logger
from robotd.motion.base_kinematics import BaseKinematics
from robotd.motion.dead_reckoning import Odometry
from robotd.motion.planar import Pose

log = get_logger("base")

JUMP = 3.0  # times the wheel speed limit: a larger step means the position was renumbered


class BaseOdometry:
    """Pose from the wheel positions of the process image. Any thread, except ``track``.

    Args:
        wheels: kinematics of the base.
        wheel_axes: axes of the wheels, in the order of ``wheels``.
        wrap_rad: range after which a wheel's position begins again; None: it never does.
        wheel_velocity: limit of a wheel, rad/s.
        period_s: of the control loop.
    """

    def __init__(
        self,
        wheels: BaseKinematics,
        wheel_axes: tuple[int, ...],
        wrap_rad: float | None,
        wheel_velocity: float,
        period_s: float,
    ) -> None:
        self._odometry = Odometry(wheels, wrap_rad)
        self._wheel_axes = wheel_axes
        self._jump = JUMP * wheel_velocity
        self._period_s = period_s
        self._fresh_ns = 0
        self._lock = threading.Lock()

    @property
    def pose(self) -> Pose:
        """Pose relative to the start or the last reset."""
        return self._odometry.pose

    def reset(self, pose: Pose) -> None:
        """Make ``pose`` the current one."""
        with self._lock:
            self._odometry.reset(pose)

    def rebase(self) -> None:
        """Keep the pose, and take the next wheel positions as the baseline."""
        with self._lock:
            self._odometry.rebase()

    def track(self, image: ProcessImage) -> None:
        """Add the motion since the last image. Control-loop thread."""
        positions = [float(image.position[axis]) for axis in self._wheel_axes]
        elapsed_s = (image.fresh_ns - self._fresh_ns) / NANOSECONDS
        if elapsed_s <= 0.0 or not math.isfinite(sum(positions)):
            return
        self._fresh_ns = image.fresh_ns
        longest_step = self._jump * max(elapsed_s, self._period_s)
        with self._lock:
            moved = self._odometry.update(positions, longest_step)
        if not moved:
            log.warning("a wheel's position was renumbered; odometry goes on from there")
