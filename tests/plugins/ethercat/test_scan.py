"""Scan of a bus, its lines and its sections; doctor; the command line."""

from __future__ import annotations

import json
import socket
from pathlib import Path

import pytest
from click.testing import CliRunner
from tests.fakes import FakeClock
from tests.plugins.ethercat.fake_bus import FakeBus

import robotd_ethercat.bus_scan  # before it is patched: it takes Soem from the other module
import robotd_ethercat.soem
from robotd_ethercat import machine_check
from robotd_ethercat.al_status import AlState
from robotd_ethercat.cli import ethercat
from robotd_ethercat.machine_check import check_machine


@pytest.fixture
def bus(monkeypatch: pytest.MonkeyPatch) -> FakeBus:
    made = FakeBus(FakeClock(), drives=2)
    made.slaves = []
    made.all[0].alias = 5
    made.all[0].values |= {(0x608F, 1): 1 << 20, (0x608F, 2): 1}
    monkeypatch.setattr(robotd_ethercat.soem, "Soem", lambda *_: made)
    monkeypatch.setattr("robotd_ethercat.bus_scan.Soem", lambda *_: made)
    return made


BUS = ("--interface", "eth7")


def run(*arguments: str) -> str:
    outcome = CliRunner().invoke(ethercat, arguments, catch_exceptions=False)
    assert outcome.exit_code == 0, outcome.output
    return outcome.output


def test_the_scan_lists_identity_state_and_modes(bus: FakeBus) -> None:
    lines = run("scan", *BUS).splitlines()
    assert lines[0].startswith("slave   0: CiA 402, alias 5, vendor 0x00001234, product 0x00005678")
    assert "PreOp, 'drive0', 13 bytes out, 23 in; profile_position" in lines[0]
    assert lines[-1] == "3 slaves on eth7"


def test_a_scan_without_slaves_says_what_to_check(bus: FakeBus) -> None:
    bus.all[0].present = False
    assert (
        run("scan", *BUS)
        == "0 slaves on eth7: check power and the cable to the IN port of the first one\n"
    )


def test_the_scan_shows_an_al_status_in_words(bus: FakeBus) -> None:
    bus.all[1].rejects[AlState.PRE_OP] = 0x0016
    assert "Init (AL status 0x0016: invalid mailbox configuration in PreOp" in run("scan", *BUS)


def test_the_sections_are_those_of_a_new_robot(bus: FakeBus) -> None:
    found = json.loads(run("scan", "--json", *BUS))
    assert found["backend"] == "ethercat"
    assert found["options"] == {"interface": "eth7"}
    assert found["axes"][0] == {
        "slave": 0,
        "identity": {"vendor_id": 0x1234, "product_code": 0x5678},
        "alias": 5,
        "counts_per_rad": pytest.approx((1 << 20) / 6.283185307),
    }
    assert [one["slave"] for one in found["slaves"]] == [0, 1, 2]


def test_the_mapping_is_shown_as_the_options_name_it(bus: FakeBus) -> None:
    text = run("pdo", *BUS, "1")
    assert "rx_pdos: 0x1C12, 13 bytes to the slave\n  0x1600\n    0x6040:00 16 bit" in text
    assert "tx_pdos: 0x1C13, 23 bytes of the slave" in text


def test_objects_are_read_and_written(bus: FakeBus) -> None:
    assert "3000" in run("sdo", "read", *BUS, "0", "0x6072")
    assert "500" in run("sdo", "write", *BUS, "1", "0x6072", "0", "500")
    assert bus.all[1].values[0x6072, 0] == 500
    assert "0xFFFFFFFB" in run("sdo", "write", *BUS, "1", "0x607A", "0", "-5")


def test_a_value_that_does_not_fit_is_not_written(bus: FakeBus) -> None:
    outcome = CliRunner().invoke(ethercat, ["sdo", "write", *BUS, "1", "0x6072", "0", "70000"])
    assert "value 70000 does not fit in 2 bytes" in str(outcome.exception)
    assert not bus.all[1].written


def test_a_slave_that_is_not_there_is_an_error(bus: FakeBus) -> None:
    outcome = CliRunner().invoke(ethercat, ["sdo", "read", *BUS, "7", "0x1000"])
    assert "slave 7 is not on the bus: it has 3 slaves, 0 to 2" in str(outcome.exception)
    outcome = CliRunner().invoke(ethercat, ["sdo", "read", *BUS, "7", "abc"])
    assert "'abc' is not a number" in outcome.output


def test_the_doctor_lists_slaves_that_have_errors(
    bus: FakeBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    bus.all[2].rejects[AlState.PRE_OP] = 0x0016
    monkeypatch.setattr(machine_check, "check_machine", lambda interface: iter(()))
    outcome = CliRunner().invoke(ethercat, ["doctor", *BUS, "--slaves"])
    assert outcome.exit_code == 1
    assert "FAILED   slave   2" in outcome.output
    bus.all[0].present = False
    outcome = CliRunner().invoke(ethercat, ["doctor", *BUS, "--slaves"])
    assert "no slave answers" in outcome.output


def test_the_doctor_finds_what_delays_frames(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    folder = tmp_path / "eth9"
    (folder / "device").mkdir(parents=True)
    (folder / "operstate").write_text("down\n")
    (folder / "speed").write_text("1000\n")
    answers = {
        "ip": "eth9 UP 10.0.0.1/24\n",
        "-k": "generic-receive-offload: on\nlarge-receive-offload: off\n",
        "-a": "Autonegotiate:\ton\nRX:\ton\nTX:\ton\n",
        "-c": "rx-usecs: 50\ntx-usecs: 0\n",
    }
    monkeypatch.setattr(machine_check, "NETWORK", tmp_path)
    monkeypatch.setattr(machine_check, "ISOLATED", tmp_path / "none")
    monkeypatch.setattr(machine_check, "REALTIME", tmp_path / "none")
    monkeypatch.setattr(machine_check.shutil, "which", lambda name: name)
    monkeypatch.setattr(socket, "if_nameindex", lambda: [(1, "eth9")])
    monkeypatch.setattr(
        machine_check, "_tool", lambda *line: answers["ip" if line[0] == "ip" else line[1]]
    )
    text = "\n".join(f"{found.verdict} {found.what}" for found in check_machine("eth9"))
    for expected in (
        "warning no real-time kernel",
        "failed eth9 is down",
        "warning eth9 runs at 1000 Mbit/s",
        "warning eth9 has address 10.0.0.1/24",
        "warning offloads on: generic-receive-offload",
        "warning flow control on",
        "warning IRQ coalescing: rx 50 µs, tx 0 µs",
    ):
        assert expected in text
    answers |= {"ip": "eth9 UP\n", "-k": "", "-a": "RX:\toff\n", "-c": "rx-usecs: 0\n"}
    (folder / "operstate").write_text("up\n")
    (folder / "device").rmdir()
    (tmp_path / "rt").touch()
    monkeypatch.setattr(machine_check, "REALTIME", tmp_path / "rt")
    text = "\n".join(found.what for found in check_machine("eth9"))
    assert "real-time kernel" in text
    assert "no IRQ coalescing" in text
    assert "flow control" not in text
    assert "offloads off" in text
    assert "Mbit/s" not in text  # a virtual interface


def test_the_doctor_ends_at_an_interface_that_does_not_exist() -> None:
    findings = list(check_machine("none7"))
    assert findings[-1].verdict == "failed"
    assert findings[-1].what == "no interface 'none7'"


@pytest.mark.parametrize(
    "words", [("scan",), ("pdo", "0"), ("sdo", "read", "0", "0x1000"), ("doctor", "--slaves")]
)
def test_no_interface_is_used_that_the_user_has_not_named(
    bus: FakeBus, words: tuple[str, ...]
) -> None:
    outcome = CliRunner().invoke(ethercat, words)
    assert outcome.exit_code == 2
    assert "--interface" in outcome.output
    assert not bus.interfaces


def test_the_doctor_lists_the_interfaces_and_sends_nothing(
    bus: FakeBus, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """One with an address, one without, and a wireless one."""
    (tmp_path / "wlan0" / "wireless").mkdir(parents=True)
    for name in ("eth0", "eth1"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "operstate").write_text("up\n")
    monkeypatch.setattr(machine_check, "NETWORK", tmp_path)
    names = ("lo", "eth0", "eth1", "wlan0")
    monkeypatch.setattr(socket, "if_nameindex", lambda: list(enumerate(names, 1)))
    addresses = {"eth0": "eth0 UP fe80::1/64 10.0.0.2/24\n"}
    monkeypatch.setattr(machine_check, "_tool", lambda *line: addresses.get(line[-1], ""))
    lines = CliRunner().invoke(ethercat, ["doctor"]).output.splitlines()
    assert lines[-4:] == [
        "warning  eth0 (up) has address 10.0.0.2/24",
        "         it carries other traffic: not an interface for a bus",
        "ok       eth1 (up) has no address",
        "         --interface eth1 checks it",
    ]
    assert not bus.interfaces


def test_a_tool_that_is_missing_gives_nothing() -> None:
    assert machine_check._tool("no-such-tool-7") == ""
