"""An alarm of one part of a mobile manipulator, while the other part moves."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from tests.core.control.base_harness import BaseHarness, running

from robotd.control.loop.setpoint_source import Outcome
from robotd.descriptor import load_robot_descriptor
from robotd.motion import TrajectoryRequest

SPEED_M_S = 0.4
CODE = 17


@pytest.fixture
def harness() -> Iterator[BaseHarness]:
    yield from running(load_robot_descriptor("mobile_manipulator"))


def drive_on(harness: BaseHarness) -> None:
    """A client sends a twist all the time."""
    harness.drive(SPEED_M_S, 0.0, 1.0)
    harness.robot.control_loop.every(
        20.0, "client", lambda image: harness.base.command(SPEED_M_S, 0.0, 0.0)
    )


def test_the_base_drives_on_while_the_arm_is_in_alarm_and_recovers(harness: BaseHarness) -> None:
    robot, joint = harness.robot, harness.robot.joint_axes[2]
    drive_on(harness)
    robot.fault_injector.trip(joint, CODE)
    harness.run(1.0)
    assert robot.image.amp_alarm[joint]
    assert harness.twist.linear == pytest.approx(SPEED_M_S, abs=0.02)
    lines = list[str]()
    robot.recover(lines.append)
    assert harness.twist.linear == pytest.approx(SPEED_M_S, abs=0.02)
    assert robot.image.servo_on[joint]
    [change] = re.findall(r"largest change of position (\S+) rad \((\S+)\)", lines[-1])
    assert float(change[0]) < 1e-3
    assert change[1] == robot.axes.names[joint]


def test_the_arm_moves_on_while_a_wheel_is_in_alarm(harness: BaseHarness) -> None:
    """The base stops, and only with a recovery and a new command it drives again."""
    robot = harness.robot
    wheel, count = robot.base.settings.axes[0], len(robot.joint_names)
    harness.drive(SPEED_M_S, 0.0, 1.0)
    request = TrajectoryRequest.from_rows(robot.joint_names, [3.0], [[0.3] * count])
    with robot.follower.follow(request) as execution:
        harness.run(0.5)
        robot.fault_injector.trip(wheel, CODE)
        harness.run(1.5)
        assert harness.twist.linear == pytest.approx(0.0, abs=1e-3)
        harness.wait(lambda: execution.outcome is not None)
    assert execution.outcome is Outcome.SUCCEEDED
