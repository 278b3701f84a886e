"""Faults of drives in another process, and the commands of ``robotd canopen``."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from click.testing import CliRunner
from structlog.testing import capture_logs
from tests.plugins.canopen.bus.drives_process import GROUP, PORT, DrivesProcess, write_robot
from tests.plugins.canopen.bus.harness import Harness, broken

from robotd.cli import main
from robotd.clock import MonotonicClock
from robotd.control.loop.setpoint_source import Outcome
from robotd.descriptor import load_robot_descriptor
from robotd.errors import NotReady
from robotd.plugin.manager import load_backend
from robotd.robot import Robot

HEALTHY = (0, 1, 2, 4, 5)  # joint4 is the one that breaks


@pytest.fixture(scope="module")
def process() -> Iterator[DrivesProcess]:
    with DrivesProcess() as running:
        yield running


@pytest.fixture
def drives(process: DrivesProcess) -> DrivesProcess:
    """Healthy, whatever the test before left behind."""
    if not process.running:
        process.start()
    process.inject("4 heal")
    return process


@contextmanager
def served(folder: Path) -> Iterator[Harness]:
    descriptor = load_robot_descriptor(str(write_robot(folder)))
    made = Robot(descriptor, load_backend("canopen"), MonotonicClock())
    try:
        made.start()
        yield Harness(made)
    finally:
        made.shutdown()


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ("trip 0x3210", "amplifier alarm 12816 (node 4: EMCY 0x3210 DC link over-voltage)"),
        ("silence", "drive is offline (node 4: TPDO"),
        ("reboot", "drive is offline (node 4: it was reset and has lost its configuration"),
        ("drop 1", "drive is offline (node 4: TPDO"),
        ("statusword 0x0250", "joint4"),
    ],
)
def test_a_fault_and_the_way_back(
    drives: DrivesProcess, tmp_path: Path, fault: str, reason: str
) -> None:
    with served(tmp_path) as harness:
        stop = broken(harness, lambda: drives.inject(f"4 {fault}"), HEALTHY)
        assert stop.execution.outcome is Outcome.FAULT
        assert reason in stop.execution.message
        assert stop.is_controlled
        drives.inject("4 heal")
        harness.robot.connection.start_communication()
        harness.until(lambda: harness.robot.connection.ready and not harness.image.offline.any())
        harness.robot.servos.enable()
        assert harness.follow(0.8, 0.0).outcome is Outcome.SUCCEEDED


def test_power_off_and_on_of_all_drives(drives: DrivesProcess, tmp_path: Path) -> None:
    with served(tmp_path) as harness:
        stop = broken(harness, drives.stop, healthy=())
        assert stop.execution.outcome is Outcome.FAULT
        assert re.search(r"node \d", stop.execution.message)  # whichever is missed first
        assert "has not come for" in stop.execution.message
        assert harness.robot.connection.fault.endswith("more nodes")
        # The module, which has no cyclic PDO, is missed by its heartbeat; a start leaves out a node
        # that is still online.
        harness.until(lambda: len(harness.master.supervision.lost) == len(harness.master.nodes))
        drives.start()
        harness.robot.connection.start_communication()
        harness.until(lambda: harness.robot.connection.ready and not harness.image.offline.any())
        harness.robot.servos.enable()
        assert harness.follow(0.8, 0.2).outcome is Outcome.SUCCEEDED


def test_loss_and_return_are_one_log_line_each(drives: DrivesProcess, tmp_path: Path) -> None:
    with served(tmp_path) as harness, capture_logs() as lines:
        broken(harness, drives.stop, healthy=())
        harness.until(lambda: len(harness.master.supervision.lost) == len(harness.master.nodes))
        drives.start()
        harness.until(lambda: not harness.master.supervision.silent)
        with pytest.raises(NotReady, match=r"joint1 \(node 1\).*start communication again"):
            harness.robot.connection.require_ready()
        harness.robot.connection.start_communication()
    found = [line for line in lines if line["log_level"] in ("warning", "error")]
    lost, returned = found
    assert lost["event"] == "device lost"
    assert re.match(r"joint\d \(node \d\): TPDO", lost["reason"])  # whichever is missed first
    assert "start communication" in returned["event"]
    assert returned["nodes"].endswith("joint6 (node 6), I/O module (node 16)")
    assert not [line for line in found if "exc_info" in line]


@pytest.mark.daily
def test_scan_and_sdo(drives: DrivesProcess) -> None:
    bus = ["--interface", "udp_multicast", "--channel", f"{GROUP}#{PORT}"]
    runner = CliRunner()
    found = runner.invoke(main, ["canopen", "scan", *bus])
    assert found.exit_code == 0, found.output
    assert "7 nodes" in found.output
    assert "node   3: CiA 402" in found.output
    scanned = runner.invoke(main, ["canopen", "scan", *bus, "--json"])
    scan = json.loads(scanned.output)
    assert [axis["node"] for axis in scan["axes"]] == [1, 2, 3, 4, 5, 6]
    assert {axis["stream_mode"] for axis in scan["axes"]} == {"csp"}
    assert [module["node"] for module in scan["io"]] == [16]
    assert "cyclic_position" in scan["nodes"][0]["modes"][0]
    assert scan["options"]["bus"]["options"] == {"port": PORT}
    read = runner.invoke(main, ["canopen", "sdo", "read", *bus, "3", "0x1008"])
    assert "'CiA 402 servo drive'" in read.output
    written = runner.invoke(main, ["canopen", "sdo", "write", *bus, "3", "0x6081", "0", "1234"])
    assert "1234" in written.output
    negative = runner.invoke(main, ["canopen", "sdo", "write", *bus, "3", "0x607C", "0", "-5"])
    assert "0xFFFFFFFB" in negative.output
