"""``robotd wmx scan`` on the stand-in's network, and the robot that is made of it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from robotd.descriptor import load_robot_descriptor
from standin_port import port

URDF = Path(__file__).resolve().parents[3] / "tests" / "urdf" / "six_axis.urdf"


def robotd(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-P", "-m", "robotd", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_slaves_are_listed_and_the_engine_is_left_as_it_was() -> None:
    done = robotd("wmx", "scan")
    assert done.returncode == 0, done.stdout + done.stderr
    lines = done.stdout.splitlines()
    assert lines[-1] == f"{len(lines) - 1} slaves"
    assert "master 0 slave   0: 1 axes, vendor 0x" in lines[0]
    assert "communicating" not in port("show").lower()


def test_a_robot_is_made_of_the_scan(tmp_path: Path) -> None:
    scan = tmp_path / "bus.json"
    scan.write_text(robotd("wmx", "scan", "--json").stdout)
    slaves = json.loads(scan.read_text())["slaves"]
    assert all(slave["vendor_id"] for slave in slaves)
    made = robotd(
        "new-robot", "arm", "--urdf", str(URDF), "--bus", str(scan), "--into", str(tmp_path)
    )
    assert made.returncode == 0, made.stdout + made.stderr
    robot = load_robot_descriptor(tmp_path / "arm")
    assert robot.backends["wmx"] == {}
    assert "# axis 0, " in (tmp_path / "arm" / "robot.yaml").read_text()
    assert robotd("check", "--robot", str(tmp_path / "arm"), "--backend", "wmx").returncode == 0


def test_a_network_without_slaves_is_empty() -> None:
    port("topology", 0, 0)
    assert robotd("wmx", "scan").stdout == "0 slaves\n"


def test_a_locked_engine_is_an_error() -> None:
    port("device_locked", 1)
    done = robotd("wmx", "scan")
    assert done.returncode == 5
    assert "the EtherCAT network cannot be scanned" in done.stderr
