"""A robot on a fake EtherCAT bus and a clock that the test advances."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import pytest
from tests.plugins.ethercat.fake_bus import COUNTS_PER_RAD, FakeBus, FakeSlave

import robotd_ethercat.soem
from robotd.clock.simulated import SteppedClock
from robotd.descriptor import RobotDescriptor
from robotd.device.capabilities import Capability
from robotd.plugin.manager import load_backend
from robotd.robot import Robot
from robotd_cia402.device import Cia402Device
from robotd_ethercat.master import Master
from robotd_ethercat.slaves_process import Simulation
from robotd_ethercat.supervision import Supervision

PATIENCE_S = 5.0


def descriptor(drives: int = 2, **options: Any) -> RobotDescriptor:
    """Return a robot of ``drives`` joints and a module behind them; ``options`` of the section."""
    section = {
        "interface": "eth0",
        "axis_defaults": {"counts_per_rad": COUNTS_PER_RAD},
        "axes": [{"axis": number, "slave": number} for number in range(drives)],
        "io": [{"slave": drives, "input_length": 2, "output_length": 2}],
        **options,
    }
    joints = [
        {"name": f"joint{number + 1}", "axis": number, "lower_rad": -3, "upper_rad": 3,
         "velocity_rad_s": 2, "acceleration_rad_s2": 10}
        for number in range(drives)
    ]  # fmt: skip
    return RobotDescriptor.model_validate(
        {
            "schema": 1, "name": "test", "axes": drives, "joints": joints,
            "backend": "ethercat", "backends": {"ethercat": section}, "engine": {"open_tries": 1},
        }
    )  # fmt: skip


class Harness:
    """Robot, its bus and the parts between them; one thread."""

    def __init__(self, patch: pytest.MonkeyPatch, drives: int = 2, **options: Any) -> None:
        self.clock = SteppedClock()
        self.bus = FakeBus(self.clock, drives)
        patch.setattr(robotd_ethercat.soem, "Soem", lambda *_: self.bus)
        patch.setattr(Supervision, "begin", lambda _: None)  # the test calls check() itself
        backend = load_backend("ethercat")
        backend.capabilities |= {Capability.SIMULATED}  # here: it takes this clock
        self.robot = Robot(descriptor(drives, **options), backend, self.clock)
        self.image = self.robot.image
        wrapped = vars(self.robot.connection._driver)["wrapped"]
        self.device = cast("Cia402Device[Master, Simulation]", wrapped)

    @property
    def master(self) -> Master:
        return self.device.master

    def slave(self, number: int) -> FakeSlave:
        return self.bus.all[number]

    def until(self, condition: Callable[[], object], timeout_s: float = PATIENCE_S) -> None:
        """Advance the clock until ``condition``."""
        for _ in range(round(timeout_s / 0.002)):
            if condition():
                return
            self.robot.step(1)
        raise AssertionError("the condition did not come true")
