"""The drives in another process, over UDP multicast, and the commands of ``robotd canopen``."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from click.testing import CliRunner
from tests.canopen.rig import Rig

from robotd.cli import main
from robotd.clock import MonotonicClock
from robotd.cycle.execution import Outcome
from robotd.descriptor import load_robot_descriptor
from robotd.plugin.manager import load_backend
from robotd.robot import Robot

GROUP = "239.74.163.9"
PORT = 20000 + os.getpid() % 20000


@pytest.fixture
def drives() -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-m", "robotd", "canopen", "simulate", "--robot", "cr3a"]
    command += ["--channel", GROUP, "--port", str(PORT)]
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
    )
    assert process.stdout is not None
    assert "nodes 1, 2, 3, 4, 5, 6, 16" in process.stdout.readline()
    yield process
    process.kill()
    process.communicate()


def tell(process: subprocess.Popen[str], line: str) -> None:
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(line + "\n")
    process.stdin.flush()
    assert process.stdout.readline() == "ok\n"


@contextmanager
def robot() -> Iterator[Robot]:
    descriptor = load_robot_descriptor("cr3a", "canopen_simulated")
    bus = {"interface": "udp_multicast", "channel": GROUP, "options": {"port": PORT}}
    section = {**descriptor.backends["canopen"], "bus": bus, "simulated": False}
    descriptor = descriptor.model_copy(update={"backends": {"canopen": section}})
    made = Robot(descriptor, load_backend("canopen"), MonotonicClock())
    try:
        made.start()
        yield made
    finally:
        made.shutdown()


def test_trajectory_fault_and_recovery(drives: subprocess.Popen[str]) -> None:
    with robot() as made:
        rig = Rig(made)
        assert rig.follow(0.8, 0.5).outcome is Outcome.SUCCEEDED
        with made.follower.follow(rig.request(2.0, -0.5)) as execution:
            rig.until(lambda: rig.image.position[0] < 0.3)
            tell(drives, "4 trip 0x3210")
            assert execution.wait(5)
        assert execution.outcome is Outcome.FAULT
        assert "joint4" in execution.message
        made.enable_joints()
        assert rig.follow(0.8, 0.0).outcome is Outcome.SUCCEEDED


def test_scan_and_sdo(drives: subprocess.Popen[str]) -> None:
    bus = ["--interface", "udp_multicast", "--channel", f"{GROUP}#{PORT}"]
    runner = CliRunner()
    found = runner.invoke(main, ["canopen", "scan", *bus])
    assert found.exit_code == 0, found.output
    assert "7 nodes" in found.output
    assert "node   3: CiA 402" in found.output
    read = runner.invoke(main, ["canopen", "sdo", "read", *bus, "3", "0x1008"])
    assert "'CiA 402 servo drive'" in read.output
    written = runner.invoke(main, ["canopen", "sdo", "write", *bus, "3", "0x6081", "0", "1234"])
    assert "1234" in written.output
