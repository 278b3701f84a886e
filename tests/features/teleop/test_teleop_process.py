"""``robotd teleop`` as a process, on two simulated buses of servos: how it ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest
import yaml
from tests.plugins.serial_servo.sts_bus import StsBus
from tests.plugins.serial_servo.sts_servo import Servo

from robotd.api import MonotonicClock, wait_until
from robotd_teach.path_file import read_path

WAIT_S = 60.0
START = {1: -0.3, 2: 0.4}
HAND_RAD_S, HAND_PERIOD_S = 0.5, 0.01
MOVED_RAD = 0.02
MOVING, AT_REST = 150.0, 80.0  # steps/s; 0.5 rad/s are 326

pytestmark = [pytest.mark.long, pytest.mark.timeout(180)]


def write_robot(folder: Path, port: str, **options: object) -> Path:
    """Two joints on two servos."""
    limits = {
        "lower_rad": -2.5, "upper_rad": 2.5, "velocity_rad_s": 2.0, "acceleration_rad_s2": 8.0
    }  # fmt: skip
    axes = [{"axis": axis, "servo": axis + 1, "zero_tick": 2048} for axis in range(2)]
    robot = {
        "schema": 1,
        "name": folder.name,
        "poses": "poses.yaml",
        "backend": "feetech",
        "cycle": {"rate_hz": 100},
        "engine": {"stale_after_s": 5.0, "servo_timeout_s": 30.0, "shutdown_s": 30.0},
        "joints": [{"name": f"joint{axis + 1}", "axis": axis, **limits} for axis in range(2)],
        "backends": {
            "feetech": {
                "port": port, "axes": axes, "reply_timeout_s": 0.2, "lost_after_s": 1.0, **options
            }
        },
    }  # fmt: skip
    folder.mkdir()
    path = folder / "robot.yaml"
    path.write_text(yaml.safe_dump(robot), encoding="utf-8")
    return path


@pytest.fixture
def buses() -> Iterator[tuple[StsBus, StsBus]]:
    """Of the leader and of the follower."""
    with ExitStack() as opened:
        made = []
        for number in range(2):
            servos = {key: Servo(angle=angle) for key, angle in START.items()}
            for servo in servos.values():
                servo.set("return_delay", 0)
            made.append(opened.enter_context(StsBus(servos, seed=number)))
        yield made[0], made[1]


@contextmanager
def moved_by_hand(bus: StsBus) -> Iterator[None]:
    """Turn joint 1 to and fro, without a pause."""
    ends = threading.Event()

    def turn() -> None:
        angle, step = bus.arm[1].angle, HAND_RAD_S * HAND_PERIOD_S
        while not ends.wait(HAND_PERIOD_S):
            step = -step if abs(angle - START[1] + step) > 1.0 else step
            angle += step
            bus.arm[1].move(angle)

    thread = threading.Thread(target=turn)
    thread.start()
    try:
        yield
    finally:
        ends.set()
        thread.join()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_slows_the_follower_to_rest_and_switches_it_off(
    number: signal.Signals, buses: tuple[StsBus, StsBus], tmp_path: Path
) -> None:
    leader, follower = buses
    robots = [
        "--leader", write_robot(tmp_path / "leader", leader.port, free=True),
        "--robot", write_robot(tmp_path / "follower", follower.port), "--path", "led",
    ]  # fmt: skip
    log = tmp_path / "output"
    with log.open("w") as output:
        process = subprocess.Popen(
            [sys.executable, "-u", "-m", "robotd", "teleop", *map(str, robots), "--yes"],
            stdout=output,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            start_new_session=True,
            env=os.environ,
        )
        try:
            found = wait_until(
                lambda: "following" in log.read_text() or process.poll() is not None,
                WAIT_S,
                MonotonicClock(),
            )
            assert found, log.read_text()
            assert process.poll() is None, log.read_text()
            with moved_by_hand(leader):
                servo = follower[1]
                assert wait_until(
                    lambda: abs(servo.motor.velocity) > MOVING, WAIT_S, MonotonicClock()
                ), "the follower does not follow"
                process.send_signal(number)
                status = process.wait(WAIT_S)
        finally:
            process.kill()
            process.wait()
    assert status == 0, log.read_text()
    assert "ended by the operator" in log.read_text()
    assert "led: " in log.read_text()
    path = read_path(tmp_path / "follower" / "paths" / "led.yaml")
    led = path.positions(["joint1", "joint2"])
    assert np.ptp(led[:, 0]) > MOVED_RAD
    assert np.abs(led[0] - [*START.values()]).max() < 0.05
    with follower.lock:
        assert [follower[key].get("torque") for key in START] == [0, 0]
        energised = [step for step in follower[1].executed if step.torque]
    assert max(abs(step.velocity) for step in energised) > MOVING
    assert abs(energised[-1].velocity) < AT_REST, "the torque went off in motion"
    with leader.lock:
        assert not any(step.torque for key in START for step in leader[key].executed)
