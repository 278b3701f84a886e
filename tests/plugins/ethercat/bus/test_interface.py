"""Network interface of the bus: one that is down, and a bus that is closed in use."""

from __future__ import annotations

import subprocess
import sys
import threading

import pytest

from robotd.errors import ConnectError, OperationError
from robotd_ethercat.bus_namespace import run_in_namespace
from robotd_ethercat.slaves_process import SlavesProcess
from robotd_ethercat.soem import Soem

DEVICE_TYPE = 0x1000


def run_on_a_cable(*command: str) -> str:
    """Run ``robotd`` where ``eth0`` is a new cable; return status, EtherCAT frames, output."""
    program = [sys.executable, "-m", "tests.plugins.ethercat.bus.frames_sent"]
    robotd = [sys.executable, "-m", "robotd", *command]
    done = subprocess.run(
        [*program, *robotd], capture_output=True, text=True, check=True, timeout=150
    )
    return done.stdout


def test_nothing_is_sent_to_an_interface_that_the_user_has_not_named() -> None:
    robot = ("--robot", "cr3a", "--backend", "ethercat")
    run = run_on_a_cable("run", *robot, "--nodes", "wmx_engine_node")
    assert run.startswith("status 3, 0 frames"), run
    conform = run_on_a_cable("conform", *robot)
    assert conform.startswith("status 3, 0 frames"), conform
    for text in (run, conform):
        assert "backends.ethercat.interface: missing: name the network interface" in text
    assert run_on_a_cable("ethercat", "scan").startswith("status 2, 0 frames")
    listed = run_on_a_cable("ethercat", "doctor")
    assert listed.splitlines()[0].endswith(", 0 frames")
    assert "eth0 (up) has no address\n         --interface eth0 checks it" in listed
    scanned = run_on_a_cable("ethercat", "scan", "--interface", "eth0")
    assert scanned.startswith("status 0")
    assert ", 0 frames" not in scanned


def bus_of(slaves: SlavesProcess) -> Soem:
    return Soem(0.7, lambda action: run_in_namespace(slaves.namespace, action))


def test_an_interface_that_is_down_is_an_error(generic_process: SlavesProcess) -> None:
    """Without it, no slave would answer. The loopback of a new namespace is down."""
    with pytest.raises(ConnectError, match="lo is down: sudo ip link set lo up"):
        bus_of(generic_process).open("lo", None)


def test_a_bus_that_is_closed_in_use_ends_the_use_with_an_error(
    generic_slaves: SlavesProcess,
) -> None:
    bus = bus_of(generic_slaves)
    bus.open(generic_slaves.interface, None)
    assert bus.find_slaves() == 3
    errors, reading = list[Exception](), threading.Event()

    def read() -> None:
        try:
            while True:
                bus.upload(0, DEVICE_TYPE, 0)
                reading.set()
        except Exception as error:  # noqa: BLE001 - judged below
            errors.append(error)

    thread = threading.Thread(target=read)
    thread.start()
    assert reading.wait(10.0)
    bus.close()
    thread.join(10.0)
    assert [type(error) for error in errors] == [OperationError]
    for use in (lambda: bus.state(0), lambda: bus.read_register(0, 0x0130, 2)):
        with pytest.raises(OperationError, match="the bus is closed"):
            use()
