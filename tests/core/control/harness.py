"""Test harness: a simulated arm on a stepped clock, with a record of its setpoints."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from tests.core.motion.helpers import peaks_of

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS
from robotd.clock.simulated import SteppedClock
from robotd.control.groups.trajectory_follower import TrajectoryFollower
from robotd.control.loop.setpoint_mixer import SourceSlot
from robotd.control.sources.trajectory_execution import TrajectoryExecution
from robotd.descriptor import RobotDescriptor
from robotd.device.axes import Move
from robotd.device.state import Operation
from robotd.motion import Tolerances, TrajectoryRequest
from robotd.motion.profile import Profile
from robotd.plugin.manager import load_backend
from robotd.robot import Robot
from robotd_sim.fault_injector import SimFaultInjector
from robotd_sim.simulation import Simulation

RATE_HZ = 500.0
PERIOD_S = 1 / RATE_HZ
ACCELERATION = 12.0  # rad/s², of every joint
HOME, FAR = (0.0, 0.0, 0.0), (1.0, -0.6, 0.3)


def peak(*executions: TrajectoryExecution) -> float:
    """Return the highest planned acceleration."""
    return max(
        float(peaks_of(execution.trajectory).acceleration.value.max()) for execution in executions
    )


def arm(joints: int = 3, **keys: Any) -> RobotDescriptor:
    return RobotDescriptor.model_validate({
        "schema": 1, "name": "arm",
        "joints": [
            {"name": f"joint{axis + 1}", "axis": axis, "lower_rad": -3.0, "upper_rad": 3.0,
             "velocity_rad_s": 3.0, "acceleration_rad_s2": ACCELERATION, "rated_torque_nm": 20.0}
            for axis in range(joints)
        ],
        "engine": {"open_retry_s": 0.0, "servo_timeout_s": 0.5},
        "cycle": {"rate_hz": RATE_HZ, "realtime_priority": 0},
    } | keys)  # fmt: skip


class Setpoints:
    """Recorded setpoints, one row per period; ``due_s`` is the monotonic time of each."""

    def __init__(self) -> None:
        self.rows: list[tuple[float, FloatArray, FloatArray]] = []

    @property
    def due_s(self) -> FloatArray:
        return np.array([row[0] for row in self.rows])

    @property
    def position(self) -> FloatArray:
        return np.array([row[1] for row in self.rows])

    @property
    def velocity(self) -> FloatArray:
        return np.array([row[2] for row in self.rows])

    @property
    def acceleration(self) -> FloatArray:
        """Mean acceleration of each period."""
        return np.diff(self.velocity, axis=0) / PERIOD_S

    def assert_smooth(self, acceleration: float) -> None:
        """Assert no missing period, consistent positions, and bounded acceleration."""
        assert np.diff(self.due_s) == pytest.approx(PERIOD_S, abs=1e-9)
        assert np.abs(self.acceleration).max() <= acceleration * 1.001 + 1e-6
        mean = (self.velocity[1:] + self.velocity[:-1]) / 2
        slack = acceleration * PERIOD_S**2  # a jump within a period, at the most
        assert np.abs(np.diff(self.position, axis=0) - mean * PERIOD_S).max() <= slack

    def assert_smooth_streams(self, acceleration: float) -> None:
        """Assert smoothness of each stream; goals from rest may be some periods apart."""
        gaps = np.flatnonzero(np.diff(self.due_s) > 1.5 * PERIOD_S) + 1
        for begin, end in pairwise([0, *gaps.tolist(), len(self.rows)]):
            stream = Setpoints()
            stream.rows = self.rows[begin:end]
            assert np.abs(stream.velocity[[0, -1]]).max() < 1e-3, "began or ended in motion"
            if begin:
                step = np.abs(stream.position[0] - self.rows[begin - 1][1]).max()
                assert step < 1e-6, "began elsewhere"
            if len(stream.rows) > 1:
                stream.assert_smooth(acceleration)


class Harness:
    """Robot on the simulation; time advances in ``run`` and in waits on its clock."""

    def __init__(
        self, descriptor: RobotDescriptor | None = None, clock: SteppedClock | None = None
    ) -> None:
        descriptor = descriptor or arm()
        self.clock = clock or SteppedClock()
        self.robot = Robot(descriptor, load_backend("sim"), self.clock)
        self.image = self.robot.image
        self.connection = self.robot.connection
        self.mixer = self.robot.control_loop._mixer
        self.simulation: Simulation = self.connection._driver.wrapped.simulation  # type: ignore[attr-defined]
        self.faults = SimFaultInjector(self.simulation)
        self.setpoints = Setpoints()
        self._tap()

    @property
    def follower(self) -> TrajectoryFollower:
        return self.robot.follower

    @property
    def slot(self) -> SourceSlot:
        return self.robot.groups.only.motion._slot

    def up(self) -> Harness:
        self.robot.start()
        return self

    def run(self, seconds: float) -> None:
        self.clock.sleep_until_ns(self.clock.now_ns() + round(seconds * NANOSECONDS))

    def stall(self, seconds: float) -> None:
        """Suspend the control loop, as on an overloaded computer; the device goes on."""
        self.clock.detach()
        self.run(seconds)
        self.clock.attach(self.robot.control_loop.period_ns, self.robot.control_loop.period)

    def until(self, condition: Callable[[], bool], timeout_s: float = 20.0) -> None:
        end_ns = self.clock.now_ns() + round(timeout_s * NANOSECONDS)
        while not condition():
            assert self.clock.now_ns() < end_ns, "not in time"
            self.run(PERIOD_S)

    def end(self, execution: TrajectoryExecution) -> TrajectoryExecution:
        self.until(lambda: execution.done)
        return execution

    def move(self, axis: int, target: float) -> None:
        """Start a plain move."""
        self.robot.axes.move([Move(axis, target, Profile(1.0, 5.0, 5.0))])

    def axes_in(self, operation: Operation) -> list[int]:
        self.run(PERIOD_S)
        return [int(axis) for axis in np.flatnonzero(self.image.operation == operation)]

    @property
    def now_s(self) -> float:
        return self.clock.now_ns() / NANOSECONDS

    @contextmanager
    def goal(
        self,
        *targets: Sequence[float],
        seconds: float = 1.0,
        tolerances: Tolerances | None = None,
        start_in_s: float | None = None,
    ) -> Iterator[TrajectoryExecution]:
        """Follow points ``seconds`` apart; leaving the block stops the goal."""
        start_ns = start_in_s and self.clock.now_ns() + round(start_in_s * NANOSECONDS)
        times_s = [seconds * (index + 1) for index in range(len(targets))]
        request = TrajectoryRequest.from_rows(self.robot.joint_names, times_s, targets)
        with self.follower.follow(request, tolerances, start_ns) as execution:
            yield execution

    def _tap(self) -> None:
        driver, joints = self.mixer._driver, list(self.robot.joint_axes)
        stream = driver.stream

        def record(position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            stream(position, velocity, due_ns)
            due_s = due_ns / NANOSECONDS
            self.setpoints.rows.append((due_s, position[joints].copy(), velocity[joints].copy()))

        driver.stream = record  # type: ignore[method-assign]
