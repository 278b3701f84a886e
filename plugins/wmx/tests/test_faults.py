"""Faults while the arm moves: a controlled stop, the reason, and recovery."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from robotd.control.loop.setpoint_source import Outcome
from robotd.control.sources.trajectory_execution import TrajectoryExecution
from robotd.device.axes import Move
from robotd.device.state import ConnectionState, Operation
from robotd.errors import ConnectError, DeviceTimeout, NotReady, OperationError
from robotd.motion.profile import Profile
from robotd.robot import Robot, build_robot
from robotd_wmx import _native
from robots import descriptor, eventually, goal, running
from standin_port import hanging_calls, port

SPAN_S = 0.02  # over which decelerations are measured
STEEPEST_RAD_S2 = 1.02 * 12.57  # the limit of joint1, and 2 % for the interpolation


@contextmanager
def broken_motion(robot: Robot, *fault: object) -> Iterator[TrajectoryExecution]:
    """A trajectory during which the fault port is given a command; it has ended with a fault."""
    with robot.follower.follow(goal([2.0], 1.0)) as execution:
        eventually(lambda: robot.image.position[0] > 0.05)
        port(*fault)  # type: ignore[arg-type]
        assert execution.wait(30.0)
    assert execution.outcome is Outcome.FAULT
    yield execution


def works_again(robot: Robot) -> None:
    """A trajectory arrives."""
    robot.servos.enable()
    with robot.follower.follow(goal([0.5], 0.0)) as execution:
        assert execution.wait(30.0)
    assert execution.outcome is Outcome.SUCCEEDED, execution.message


def reason(robot: Robot) -> str:
    """Fault text of an engine without fresh values."""
    return robot.connection._driver.fault()


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (("amp_alarm", 1, 0x7500), r"joint2.* amplifier alarm 29952 \(code 0x7500\)"),
        (("slave_lost", 1), r"joint2.* drive is offline"),
    ],
)
def test_the_other_joints_brake_along_the_path(
    tmp_path: Path, fault: tuple[object, ...], message: str
) -> None:
    with running(tmp_path) as robot:
        rows: list[tuple[float, float]] = []
        robot.control_loop.every(
            500,
            "test",
            lambda image: rows.append((image.fresh_ns * 1e-9, image.position_command[0])),
        )
        with broken_motion(robot, *fault) as execution:
            assert re.search(message, execution.message)
        eventually(lambda: bool((robot.image.operation == Operation.IDLE).all()))
    times_s, positions = np.array(rows).T
    times_s, first = np.unique(times_s, return_index=True)
    grid_s = np.arange(times_s[0], times_s[-1], SPAN_S)
    speeds = np.diff(np.interp(grid_s, times_s, positions[first])) / SPAN_S
    assert speeds.max() > 0.1
    assert np.diff(speeds).min() / SPAN_S > -STEEPEST_RAD_S2
    assert abs(speeds[-1]) < 0.01


def test_an_alarm_is_cleared_by_a_new_start(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        with broken_motion(robot, "amp_alarm", 1, 0x7500) as execution:
            assert "joint2" in execution.message
            assert "amplifier alarm 29952 (code 0x7500)" in execution.message
        eventually(lambda: bool((robot.image.operation == Operation.IDLE).all()))
        with pytest.raises(OperationError, match="amplifier alarm 29952"):
            robot.axes.servo(1, True)
        works_again(robot)
        assert robot.image.copy().reason == [""] * 6


def test_a_servo_that_did_not_come_on_in_time_stays_off(tmp_path: Path) -> None:
    with running(tmp_path, enable=False) as robot:
        port("freeze", 1)
        with pytest.raises(DeviceTimeout, match="servo on: no confirmation"):
            robot.axes._driver.servo(0, True, 0.05)
        port("freeze", 0)
        time.sleep(0.1)
        assert "axis 0 servo 0" in port("show")


def test_a_lost_slave_says_why_and_hot_connect_brings_it_back(tmp_path: Path) -> None:
    port("hot_connect_ms", 300)
    with running(tmp_path) as robot:
        with broken_motion(robot, "slave_lost", 2) as execution:
            assert "joint3" in execution.message
        network = robot.fieldbus.status(0)
        [lost] = [node for node in network.nodes if node.offline]
        assert (lost.id, lost.error_code) == (2, 0x1B)
        assert lost.fault == "no process data within the sync manager's watchdog (AL status 0x001B)"
        assert network.lost_frames > 0
        with pytest.raises(ConnectError, match="joint3"):
            robot.servos.enable()
        robot.fieldbus.start_hot_connect(0)
        assert robot.fieldbus.status(0).details["hot connect"] == "running"
        eventually(lambda: not robot.image.offline[2])
        assert robot.fieldbus.status(0).details["hot connect"] == "idle"
        assert not robot.image.servo_on[2]
        works_again(robot)


def test_a_hot_connect_that_fails_says_why(tmp_path: Path) -> None:
    port("hot_connect_abort", 5)
    with running(tmp_path) as robot:
        port("slave_lost", 2)
        robot.fieldbus.start_hot_connect(0)
        told = "aborted: a new slave did not start"
        eventually(lambda: robot.fieldbus.status(0).details["hot connect"] == told)
        assert robot.image.offline[2]
        assert robot.image.servo_on[0]


def test_an_engine_stopped_by_somebody_else_is_opened_again(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        with broken_motion(robot, "stop_engine") as execution:
            assert "Shutdown" in execution.message
        assert reason(robot) == "the engine was stopped by another program"
        assert not robot.connection.ready
        with pytest.raises(NotReady, match="not ready"):
            robot.axes.move([Move(0, 0.1, Profile(1.0, 10.0, 10.0))])
        robot.connection.close()
        robot.connection.start()
        works_again(robot)


def test_a_killed_engine_is_noticed_and_opened_again(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        with broken_motion(robot, "kill_engine"):
            eventually(lambda: reason(robot).startswith("the engine is gone: wmx 271 ("))
        assert robot.connection.state is ConnectionState.SHUTDOWN
        assert robot.connection.fault == reason(robot)
        robot.connection.restore()
        works_again(robot)


def test_an_engine_whose_calls_hang_ends_motion_and_is_named(tmp_path: Path) -> None:
    """The watchdog needs the interpreter, which the hanging call must not keep."""
    with running(tmp_path) as robot, robot.follower.follow(goal([4.0], 1.0)) as execution:
        eventually(lambda: robot.image.position[0] > 0.05)
        with hanging_calls() as hanging:
            assert execution.wait(30.0)
            assert hanging.poll() is None
        assert execution.outcome is Outcome.FAULT
        assert "the control loop hangs" in execution.message
        assert "robotd_wmx" in execution.message  # the place of the call


def test_an_expired_licence_ends_motion_and_is_named(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        with broken_motion(robot, "licence_expired", 1):
            assert reason(robot) == "the licence is invalid or has expired"
        assert robot.connection.state is ConnectionState.RUNNING
        robot.connection.settings = robot.connection.settings.model_copy(
            update={"communication_timeout_s": 0.5}
        )
        with pytest.raises(NotReady, match="licence"):
            robot.connection.start_communication()
        port("licence_expired", 0)
        robot.connection.start_communication()
        works_again(robot)


def test_communication_that_another_program_stopped_is_started_again(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        other = _native.Device()
        other.create(_native.SDK_PATH, 5000)
        with robot.follower.follow(goal([2.0], 1.0)) as execution:
            eventually(lambda: robot.image.position[0] > 0.05)
            other.stop_communication(5000)
            assert execution.wait(30.0)
        assert execution.outcome is Outcome.FAULT
        assert reason(robot).startswith("communication was stopped by another program")
        other.close(False)
        robot.connection.start_communication()
        assert reason(robot) == ""
        works_again(robot)


def test_what_a_start_up_cannot_do_is_said(tmp_path: Path) -> None:
    port("device_locked", 1000)
    robot = build_robot(descriptor(tmp_path, lock_timeout_s=0.3), "wmx")
    with pytest.raises(ConnectError, match=r"wmx 297 \(device locked by another process\)"):
        robot.start()
    port("device_locked", 0)
    robot.start()
    assert robot.connection.ready
    robot.shutdown()


DAEMON = """\
import sys
from robotd.robot import open_robot
from robotd.device.axes import Jog
from robotd.motion.profile import Profile
with open_robot(sys.argv[1], "wmx") as robot:
    robot.axes.set_command_mode(0, 1)
    robot.axes.jog([Jog(0, Profile(0.5, 5.0, 5.0))])
    print("moving", flush=True)
    sys.stdin.read()
"""


def position() -> float:
    """Return the position of axis 0, as the engine has it."""
    words = next(line for line in port("show").splitlines() if line.startswith("axis 0 ")).split()
    return float(words[words.index("position") + 1])


def test_the_engine_stops_the_axes_when_the_daemon_dies(tmp_path: Path) -> None:
    watchdog_s, speed_rad_s = 0.2, 0.5
    command = [sys.executable, "-P", "-c", DAEMON, str(descriptor(tmp_path, watchdog_s=watchdog_s))]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, **pipes) as daemon:  # type: ignore[call-overload]
        assert "moving" in iter(lambda: daemon.stdout.readline().strip(), "")
        assert "axis 0 servo 1 state 8" in port("show")  # OperationState::Velocity
        daemon.kill()
        killed_s, start = time.monotonic(), position()
    eventually(lambda: "engine 0" in port("show"))
    took_s, distance = time.monotonic() - killed_s, position() - start
    print(f"killed at {speed_rad_s} rad/s: at rest within {took_s:.3f} s and {distance:.3f} rad")
    assert distance <= speed_rad_s * min(took_s, 2 * watchdog_s)
    rest = position()
    time.sleep(0.05)
    assert position() == rest


def test_a_link_that_comes_up_after_the_start_timed_out_is_not_ready(tmp_path: Path) -> None:
    port("communication_ms", 1500)
    robot = build_robot(descriptor(tmp_path), "wmx")
    settings = robot.connection.settings
    robot.connection.settings = settings.model_copy(update={"communication_timeout_s": 0.3})
    with pytest.raises((DeviceTimeout, OperationError)):
        robot.start()
    time.sleep(2.0)  # the engine has ended its attempt by then, one way or the other
    assert not robot.connection.ready
    assert not any(f"axis {axis} servo 1" in port("show") for axis in range(6))
    robot.connection.settings = settings
    robot.connection.start_communication()
    assert robot.connection.ready
    assert "52953088" in robot.connection.dump_parameters(0)
    robot.shutdown()
