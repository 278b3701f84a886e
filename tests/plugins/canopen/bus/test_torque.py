"""Cyclic synchronous torque on simulated CANopen drives."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from tests.torque_checks import CHECKS

from robotd.clock import MonotonicClock
from robotd.descriptor import load_robot_descriptor
from robotd.plugin.manager import load_backend
from robotd.robot import Robot


@pytest.fixture(scope="module")
def robot() -> Iterator[Robot]:
    descriptor = load_robot_descriptor(str(Path(__file__).parent / "torque_drives.yaml"))
    robot = Robot(descriptor, load_backend("canopen"), MonotonicClock())
    try:
        robot.start()
        yield robot
    finally:
        robot.shutdown()


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: str(check.__name__))
def test_torque_stream(robot: Robot, check: Callable[[Robot], None]) -> None:
    check(robot)
