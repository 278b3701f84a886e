"""Streamed velocities end with what stops their axes, and when no setpoint comes."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from robotd.device.state import CommandMode, Operation
from robotd.robot import Robot
from robotd_wmx.velocity_stream import TIMEOUT_S
from robots import eventually, running
from standin_port import port

AXIS, SPEED_RAD_S = 2, 0.1
LOOK_S = 0.1


def servo_off(robot: Robot) -> None:
    robot.axes.servo(AXIS, False)


def alarm(robot: Robot) -> None:
    port("amp_alarm", AXIS, 0x7500)
    eventually(lambda: bool(robot.image.amp_alarm[AXIS]))


def send(robot: Robot, seconds: float) -> None:
    """Send setpoints, as a client does that has not noticed the end of its stream."""
    speeds, end_s = np.full(6, SPEED_RAD_S), time.monotonic() + seconds
    while time.monotonic() < end_s:
        robot.axes._driver.stream(speeds, speeds, 0)
        time.sleep(0.002)


@pytest.mark.parametrize("end", [servo_off, alarm])
def test_an_ended_stream_takes_no_setpoints(tmp_path: Path, end: Callable[[Robot], None]) -> None:
    with running(tmp_path) as robot:
        robot.axes.set_command_mode(AXIS, CommandMode.VELOCITY)
        driver, image = robot.axes._driver, robot.image
        driver.begin_stream([AXIS])
        send(robot, 0.2)
        assert image.operation[AXIS] == Operation.STREAM
        end(robot)
        eventually(lambda: bool(abs(image.velocity[AXIS]) < 1e-3))
        driver.clear_alarm(AXIS, 3.0)
        driver.servo(AXIS, True, 3.0)
        start = image.position[AXIS]
        send(robot, LOOK_S)
        assert image.position[AXIS] == pytest.approx(start, abs=1e-3)
        assert image.operation[AXIS] == Operation.IDLE


def test_an_axis_stops_without_setpoints(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        robot.axes.set_command_mode(AXIS, CommandMode.VELOCITY)
        robot.axes._driver.begin_stream([AXIS])
        send(robot, 0.2)
        start = robot.image.position[AXIS]
        eventually(lambda: robot.image.operation[AXIS] == Operation.IDLE, 2.0)
        assert robot.image.position[AXIS] > start
        eventually(lambda: bool(abs(robot.image.velocity[AXIS]) < 1e-3), 1.0)


def test_a_stream_that_has_ended_is_not_missed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with running(tmp_path) as robot:
        robot.axes.set_command_mode(AXIS, CommandMode.VELOCITY)
        driver = robot.axes._driver
        driver.begin_stream([AXIS])
        send(robot, 0.2)
        driver.end_stream([AXIS])
        eventually(lambda: robot.image.operation[AXIS] == Operation.IDLE)
        end_s = time.monotonic() + 2.0 * TIMEOUT_S
        eventually(lambda: time.monotonic() > end_s)
    assert "no setpoints arrive" not in capsys.readouterr().err
