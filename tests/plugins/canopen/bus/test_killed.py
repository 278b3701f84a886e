"""robotd is killed while drives in another process move: they stop by themselves."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.features.conformance.runs.kit import run_kit
from tests.plugins.canopen.bus.drives_process import DrivesProcess, write_robot
from tests.plugins.canopen.bus.moving import SPEED_RAD_S, Motion
from tools.endurance.rest import come_to_rest

from robotd.clock import MonotonicClock, wait_until

KILLED = "test_watchdog.py::test_axes_stop_when_their_process_is_killed"
HEARTBEAT_LOST = 0x8130
COUNTS_PER_RAD = 166886.0535  # of the arm
WATCHDOG_S = 0.5
BRAKING_S = SPEED_RAD_S / 40.0  # quick_stop_deceleration_rad_s2
SYNCS_S = 2 * 0.004  # which a drive goes on without a setpoint
LATE_S = 0.15  # of this computer: its signal, its drives' tick of 10 ms, its look at them


@pytest.fixture(scope="module")
def drives() -> Iterator[DrivesProcess]:
    with DrivesProcess() as process:
        yield process


@pytest.mark.parametrize(
    ("motion", "limit_s"),
    [(Motion.STREAMED, SYNCS_S), (Motion.VELOCITY, WATCHDOG_S + BRAKING_S)],
)
def test_the_drives_stop_by_themselves(
    drives: DrivesProcess, tmp_path: Path, motion: Motion, limit_s: float
) -> None:
    path = write_robot(tmp_path, heartbeat_timeout_s=WATCHDOG_S)
    command = [sys.executable, "-m", "tests.plugins.canopen.bus.moving", str(path), motion]
    with (
        drives.observed() as drive,
        subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as robot,
    ):
        assert robot.stdout is not None
        assert "moving\n" in robot.stdout, "it ended early"
        robot.send_signal(signal.SIGKILL)
        rest = come_to_rest(lambda: drive.position() / COUNTS_PER_RAD)
        assert rest.seconds <= limit_s + LATE_S
        assert abs(rest.distance) <= SPEED_RAD_S * (limit_s + LATE_S)
        assert wait_until(
            lambda: drive.error_code() == HEARTBEAT_LOST, 2 * WATCHDOG_S, MonotonicClock()
        )
    assert robot.returncode == -signal.SIGKILL


@pytest.mark.parametrize(("watchdog_s", "stops"), [(WATCHDOG_S, True), (30.0, False)])
def test_the_kit_finds_drives_without_a_watchdog(
    drives: DrivesProcess, tmp_path: Path, watchdog_s: float, stops: bool
) -> None:
    del drives
    robot = write_robot(tmp_path, heartbeat_timeout_s=watchdog_s)
    outcome = run_kit("canopen", KILLED, robot=str(robot))
    assert (outcome.passed, set(outcome.failed)) == (
        ({KILLED}, set()) if stops else (set(), {KILLED})
    )
