"""A robot on simulated EtherCAT slaves, real time, real frames through pysoem."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import cast

from robotd.clock import MonotonicClock, wait_until
from robotd.descriptor import load_robot_descriptor
from robotd.errors import RobotdError
from robotd.motion import TrajectoryRequest
from robotd.plugin.manager import load_backend
from robotd.robot import Robot
from robotd_cia402.device import Cia402Device
from robotd_ethercat.master import Master
from robotd_ethercat.slaves_process import Simulation

SMALL = str(Path(__file__).parent / "three_drives.yaml")
PATIENCE_S = 15.0  # outlasts the stalls of a busy computer


class EthercatRobot:
    """A started robot, its device and its slaves. One thread."""

    def __init__(self, robot: Robot) -> None:
        self.robot, self.image = robot, robot.image
        wrapped = vars(robot.connection._driver)["wrapped"]
        self.device = cast("Cia402Device[Master, Simulation]", wrapped)

    @property
    def master(self) -> Master:
        return self.device.master

    def inject(self, line: str) -> None:
        assert self.device.simulation is not None
        assert self.device.simulation.inject(line) == "ok"

    def until(self, condition: Callable[[], object], timeout_s: float = PATIENCE_S) -> None:
        assert wait_until(lambda: bool(condition()), timeout_s, MonotonicClock())

    def request(self, seconds: float, *targets: float) -> TrajectoryRequest:
        return TrajectoryRequest.from_rows(self.robot.joint_names, [seconds], [list(targets)])

    def heal(self) -> None:
        """End every fault, and bring the robot back to where it takes commands."""
        self.inject("all heal")
        self.until(self._recovered)

    def _recovered(self) -> bool:
        try:
            self.robot.recover()
        except RobotdError:
            return False
        return True


@contextmanager
def started(robot: str = SMALL) -> Iterator[EthercatRobot]:
    """A started robot, shut down after the block."""
    made = Robot(load_robot_descriptor(robot), load_backend("ethercat"), MonotonicClock())
    try:
        made.start()
        yield EthercatRobot(made)
    finally:
        made.shutdown()
