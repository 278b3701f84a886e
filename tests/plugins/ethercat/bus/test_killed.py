"""robotd is killed while drives in another process move: they stop by themselves and come back."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from tests.plugins.canopen.bus.moving import SPEED_RAD_S, Motion
from tests.plugins.ethercat.bus.robot import PATIENCE_S
from tools.endurance.rest import come_to_rest

from robotd.clock import MonotonicClock, wait_until
from robotd.descriptor import load_robot_descriptor
from robotd_ethercat.slaves_process import SlavesProcess

DRIVES = 6
WATCHDOG_S = 0.4
BRAKING_S = SPEED_RAD_S / 40.0  # quick_stop_deceleration_rad_s2
LATE_S = 0.5  # stalls of the computer; its look at the drives


@pytest.fixture(scope="module")
def slaves() -> Iterator[SlavesProcess]:
    with SlavesProcess(["--robot", "cr3a", "--variant", "ethercat_simulated"]) as process:
        yield process


def moving(slaves: SlavesProcess, folder: Path, motion: Motion) -> subprocess.Popen[str]:
    """A robot on the cable of ``slaves``, in a process of its own."""
    section = {"simulated": False, "interface": slaves.interface}
    section |= {"watchdog_ms": 1000 * WATCHDOG_S, "max_lost_frames": 100}
    content = {
        "extends": str(load_robot_descriptor("cr3a").path),
        "default_variant": "killed",
        "engine": {"stale_after_s": 5.0},  # of a computer that is busy
        "variants": {"killed": {"cycle": {"rate_hz": 250}, "backends": {"ethercat": section}}},
    }
    path = folder / "robot.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    program = [sys.executable, "-m", "tests.plugins.canopen.bus.moving"]
    command = [*program, str(path), motion, "ethercat"]
    enter = ["nsenter", f"--net={slaves.namespace}"]
    return subprocess.Popen([*enter, *command], stdout=subprocess.PIPE, text=True)


@pytest.mark.parametrize("motion", Motion)
def test_the_drives_stop_by_themselves(
    slaves: SlavesProcess, tmp_path: Path, motion: Motion
) -> None:
    """The second case also shows that the drives of the first one are taken again."""
    with moving(slaves, tmp_path, motion) as robot:
        assert robot.stdout is not None
        assert "moving\n" in robot.stdout, "it ended early"
        robot.send_signal(signal.SIGKILL)
        rest = come_to_rest(lambda: float(slaves.inject("0 position")))
    assert robot.returncode == -signal.SIGKILL
    limit_s = WATCHDOG_S + BRAKING_S + LATE_S
    assert rest.seconds <= limit_s
    assert abs(rest.distance) <= SPEED_RAD_S * limit_s
    stopped = "SAFE_OP 0x001B"  # sync manager watchdog
    for number in range(DRIVES):
        command = f"{number} state"
        assert wait_until(lambda: slaves.inject(command) == stopped, PATIENCE_S, MonotonicClock())  # noqa: B023 - called here
