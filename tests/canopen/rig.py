"""A robot on simulated CANopen drives, and what the tests want of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import MonotonicClock, wait_until
from robotd.cycle.execution import Execution
from robotd.motion import TrajectoryRequest
from robotd.plugin.guard import unguarded
from robotd.robot import Robot
from robotd_canopen.device import CanopenDevice
from robotd_canopen.inject import inject
from robotd_canopen.master import Master
from robotd_canopen.simulated import DriveNode, IoNode, SimulatedNetwork


class Rig:
    """One robot. Any thread."""

    def __init__(self, robot: Robot) -> None:
        self.robot, self.image = robot, robot.image
        self.device = cast(CanopenDevice, unguarded(robot.engine._driver))
        self.master: Master = self.device.master

    @property
    def network(self) -> SimulatedNetwork:
        assert self.device.simulation is not None
        return self.device.simulation

    def drive(self, node: int) -> DriveNode:
        return cast(DriveNode, self.network.members[node])

    def module(self, node: int) -> IoNode:
        return cast(IoNode, self.network.members[node])

    def inject(self, line: str) -> None:
        assert inject(self.network, line) == "ok"

    def until(self, condition: Callable[[], bool], timeout_s: float = 5.0) -> None:
        assert wait_until(condition, timeout_s, MonotonicClock())

    def idle(self, axis: int) -> None:
        """Wait for the end of a command; it may take a period to show in the image."""
        self.master.settle()
        self.until(lambda: not self.image.operation[axis])

    def request(self, seconds: float, target: float) -> TrajectoryRequest:
        names = self.robot.joint_names
        return TrajectoryRequest.from_rows(names, [seconds], [[target] * len(names)])

    def follow(self, seconds: float, target: float) -> Execution:
        """Run a trajectory of one point to its end, whatever that is."""
        with self.robot.follower.follow(self.request(seconds, target)) as execution:
            assert execution.wait(seconds + 5)
        return execution

    def positions(self) -> FloatArray:
        return np.array(self.image.copy().position)
