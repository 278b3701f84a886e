"""Cyclic synchronous torque on simulated EtherCAT slaves."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from tests.plugins.ethercat.bus.robot import SMALL, EthercatRobot, started
from tests.torque_checks import CHECKS

from robotd.errors import InvalidArgument, NotReady
from robotd.robot import Robot

TORQUE = str(Path(__file__).parent / "torque_drives.yaml")


@pytest.fixture(scope="module")
def bus() -> Iterator[EthercatRobot]:
    with started(TORQUE) as robot:
        yield robot


def test_a_fault_in_motion_ends_the_stream(bus: EthercatRobot) -> None:
    robot = bus.robot
    stream = robot.torque_stream()
    with stream:
        stream.send([5.0, 0.0])
        bus.inject("3 trip 0x3210")
        assert stream.wait(15.0)
    assert "shoulder at" in stream.message
    assert "0x3210 DC link over-voltage" in stream.message
    bus.heal()


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: str(check.__name__))
def test_torque_stream(bus: EthercatRobot, check: Callable[[Robot], None]) -> None:
    check(bus.robot)


def test_a_joint_without_a_limit_takes_no_torque() -> None:
    with (
        started(SMALL) as bus,
        pytest.raises(InvalidArgument, match=r"shoulder: no torque limit; .*torque_limit_nm"),
    ):
        bus.robot.torque_stream()


def test_a_drive_that_does_not_map_the_torque_says_so(tmp_path: Path) -> None:
    robot = tmp_path / "robot.yaml"
    text = Path(TORQUE).read_text().replace("{index: 0x1600}, {index: 0x1603}", "{index: 0x1600}")
    robot.write_text(text.replace("three_drives.yaml", SMALL))
    with started(str(robot)) as bus:
        with pytest.raises(NotReady, match=r"shoulder: slave 3: no PDO holds 0x6071"):
            bus.robot.torque_stream()
        assert bus.robot.image.mode[:2].tolist() == [0, 0]
        bus.until(lambda: not bus.robot.axes.owner(0))
