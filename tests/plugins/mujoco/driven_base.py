"""Driving a base on MuJoCo in stepped time, beside its true pose."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

from tests.plugins.mujoco.cell import cell

from robotd.api.bases import PlanarTwist
from robotd.clock import MonotonicClock, wait_until
from robotd.motion.planar import Pose
from robotd.robot import Robot
from robotd_mujoco.physics import Physics

SETTLE_PERIODS = 40
REST_S = 5.0
CLAIM_TIMEOUT_S = 10.0  # of the thread that claims the wheels, in real time


class DrivenBase:
    """A started base, and what its odometry does not know.

    Attributes:
        robot, base, physics: as they are.
        path: odometry and true pose, after each period of ``drive``.
    """

    def __init__(self, robot: Robot) -> None:
        assert robot.base is not None
        self.robot, self.base = robot, robot.base
        self.physics: Physics = robot.device.physics
        self.path: list[tuple[Pose, Pose]] = []
        robot.step(SETTLE_PERIODS)

    @property
    def truth(self) -> Pose:
        """True pose on the floor."""
        x, y, _, _, _, sine, cosine = self.physics.root_pose()
        return Pose(float(x), float(y), math.remainder(2.0 * math.atan2(sine, cosine), math.tau))

    def drive(self, twist: PlanarTwist, seconds: float) -> None:
        """Command a twist for some time, then let the command lapse, until the wheels are free."""
        rate_hz = self.robot.descriptor.cycle.rate_hz
        for _ in range(round(seconds * rate_hz)):
            self.base.command(twist.linear, twist.angular, twist.lateral)
            # A thread claims the wheels, while simulated time is held.
            claimed = wait_until(lambda: self.base.moving, CLAIM_TIMEOUT_S, MonotonicClock())
            assert claimed, "the wheels are not claimed"
            self._step()
        self.base.command(0.0, 0.0)
        for _ in range(round(REST_S * rate_hz)):
            self._step()
            if not self.base.moving:
                return
        raise AssertionError(f"the base moves {REST_S:g} s after its last command")

    def _step(self) -> None:
        self.robot.step(1)
        self.path.append((self.base.pose, self.truth))


@contextmanager
def driven_base(robot: str, *overrides: str) -> Iterator[DrivenBase]:
    """Run a base on MuJoCo; ``overrides`` as for ``cell``."""
    with cell(*overrides, robot=robot) as started:
        yield DrivenBase(started.robot)


def errors(odometry: Pose, truth: Pose) -> tuple[float, float]:
    """Return distance in m and angle in rad between two poses."""
    turned = math.remainder(odometry.heading - truth.heading, math.tau)
    return math.hypot(odometry.x - truth.x, odometry.y - truth.y), abs(turned)
