"""Streamed velocities end with what stops their axes, and when no setpoint comes."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from robotd.device.axes import Jog, Move
from robotd.device.state import CommandMode, Operation
from robotd.errors import OperationError
from robotd.motion.profile import Profile
from robotd.robot import Robot
from robotd_wmx._native import CallError, Device
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


def send(robot: Robot, seconds: float, speed: float = SPEED_RAD_S) -> None:
    """Send setpoints, as a client does that has not noticed the end of its stream."""
    speeds, end_s = np.full(6, speed), time.monotonic() + seconds
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


def rejecting(call: str, axis: int) -> Callable[..., None]:
    """The call of the binding, rejected by the engine for one axis."""
    accepted = getattr(Device, call)

    def stop(device: Device, axes: int | list[int], *values: float) -> None:
        if axis in (axes if isinstance(axes, list) else [axes]):
            raise CallError(call, "core motion", 1, "", "")
        accepted(device, axes, *values)

    return stop


@pytest.mark.parametrize("end", ["stop", "end_stream"])
def test_a_stop_that_one_stream_rejects_ends_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, end: str
) -> None:
    other = AXIS + 1
    with running(tmp_path) as robot:
        for axis in (AXIS, other):
            robot.axes.set_command_mode(axis, CommandMode.VELOCITY)
        driver, image = robot.axes._driver, robot.image
        for rejected, stopped in ((AXIS, other), (other, AXIS)):
            call = "timed_stop_velocity"
            monkeypatch.setattr(Device, call, rejecting(call, rejected))
            driver.begin_stream([AXIS, other])
            send(robot, 0.2)
            with pytest.raises(OperationError, match="stop"):
                getattr(driver, end)([AXIS, other])
            monkeypatch.undo()
            eventually(lambda axis=stopped: bool(abs(image.velocity[axis]) < 1e-3), 2.0)
            assert abs(image.velocity_command[rejected]) == pytest.approx(SPEED_RAD_S)


@pytest.mark.parametrize(
    ("end", "call"), [("stop", "stop_motion"), ("quick_stop", "quick_stop_motion")]
)
def test_a_stop_that_a_move_rejects_ends_velocity_commands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, end: str, call: str
) -> None:
    with running(tmp_path) as robot:
        robot.axes.set_command_mode(AXIS, CommandMode.VELOCITY)
        robot.axes.jog([Jog(AXIS, Profile(SPEED_RAD_S, 5.0, 5.0))])
        robot.axes.move([Move(0, 1.0, Profile(SPEED_RAD_S, 5.0, 5.0))])
        eventually(lambda: robot.image.operation[0] == Operation.POSITION)
        monkeypatch.setattr(Device, call, rejecting(call, 0))
        with pytest.raises(OperationError, match="stop"):
            getattr(robot.axes._driver, end)([0, AXIS])
        eventually(lambda: robot.image.operation[AXIS] == Operation.IDLE, 2.0)
        assert robot.image.operation[0] == Operation.POSITION


@pytest.mark.parametrize("rejected", [AXIS, AXIS + 1])
def test_a_rejected_axis_leaves_no_other_one_at_its_last_velocity(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rejected: int
) -> None:
    """A limit switch against which the axis is commanded stops it so."""
    axes = [AXIS, AXIS + 1]
    with running(tmp_path) as robot:
        for axis in axes:
            robot.axes.set_command_mode(axis, CommandMode.VELOCITY)
        robot.axes._driver.begin_stream(axes)
        send(robot, 0.2)
        monkeypatch.setattr(Device, "start_vels", rejecting("start_vels", rejected))
        send(robot, 0.2, 0.0)
        [other] = set(axes) - {rejected}
        assert robot.image.velocity_command[other] == 0.0


def test_an_axis_stops_without_setpoints(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        robot.axes.set_command_mode(AXIS, CommandMode.VELOCITY)
        robot.axes._driver.begin_stream([AXIS])
        send(robot, 0.2)
        start = robot.image.position[AXIS]
        eventually(lambda: robot.image.operation[AXIS] == Operation.IDLE, 2.0)
        assert robot.image.position[AXIS] > start
        eventually(lambda: bool(abs(robot.image.velocity[AXIS]) < 1e-3), 1.0)


def test_a_stop_that_is_rejected_is_repeated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with running(tmp_path) as robot:
        robot.axes.set_command_mode(AXIS, CommandMode.VELOCITY)
        stop, calls = rejecting("timed_stop_velocity", AXIS), list[int]()

        def reject(device: Device, axis: int, milliseconds: float) -> None:
            calls.append(axis)
            stop(device, axis, milliseconds)

        monkeypatch.setattr(Device, "timed_stop_velocity", reject)
        robot.axes._driver.begin_stream([AXIS])
        send(robot, 0.2)
        eventually(lambda: len(calls) >= 2, 2.0)
        assert abs(robot.image.velocity_command[AXIS]) == pytest.approx(SPEED_RAD_S)
        monkeypatch.undo()
        eventually(lambda: bool(abs(robot.image.velocity[AXIS]) < 1e-3), 2.0)


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
