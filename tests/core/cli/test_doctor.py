"""``robotd doctor``, and the doctors and scans that it finds by entry points."""

from __future__ import annotations

import json
import re
import socket
from collections.abc import Callable, Iterator
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result

from robotd.api import Finding, MachineContext, diagnose, doctors, scan_network
from robotd.cli.exit_codes import ExitCode
from robotd.descriptor import load_robot_descriptor, parse_override
from robotd.entry_points import Names, PluginOrigin
from robotd.errors import InvalidArgument, OperationError, PluginError
from robotd.plugin import machine_checks
from robotd_canopen import machine_check
from robotd_canopen.bus_scan import scan
from robotd_doctor import computer_checks, network_checks, zenoh_check
from robotd_doctor.zenoh_check import zenoh_router

Robotd = Callable[..., Result]


def test_a_doctor_of_each_backend_with_hardware_is_found() -> None:
    assert {"canopen", "computer", "ethercat", "installation", "network", "wmx"} <= set(doctors())


def test_the_computer_is_checked(robotd: Robotd) -> None:
    result = robotd("doctor")
    assert result.exit_code in (ExitCode.OK, ExitCode.FAILED)
    for part in (
        "computer",
        "Linux ",
        "cores",
        "network",
        "ROS domain",
        "installation",
        "robotd 0",
    ):
        assert part in result.output
    assert re.search(r"--backend canopen \|.* ethercat \|.* wmx", result.output)


def test_findings_are_json_for_programs(robotd: Robotd) -> None:
    found = json.loads(robotd("doctor", "--backend", "canopen", "--json").output)
    assert list(found) == ["computer", "network", "installation", "canopen"]
    for finding in (finding for findings in found.values() for finding in findings):
        assert set(finding) == {"verdict", "what", "advice"}
        assert finding["verdict"] == "ok" or finding["advice"], finding


def test_an_unknown_backend_is_named(robotd: Robotd) -> None:
    result = robotd("doctor", "--backend", "canopne")
    assert result.exit_code == ExitCode.CONFIGURATION
    assert "canopen" in result.output


def fails(context: MachineContext) -> Iterator[Finding]:
    yield Finding("ok", "first")
    raise OperationError("the bus is gone")


def test_a_doctor_that_fails_is_a_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    def found(name: str, value: str) -> tuple[PluginOrigin, EntryPoint]:
        entry = EntryPoint(name, value, machine_checks.DOCTORS)
        return PluginOrigin(name, value, name, "1"), entry

    entries = {
        "acme": found("acme", "no_such_module:checks"),
        "acme-bus": found("acme-bus", f"{__name__}:fails"),
        "acmes": found("acmes", "others:checks"),
    }
    monkeypatch.setattr(machine_checks, "installed_names", lambda _: Names(entries, {}))
    monkeypatch.setattr(EntryPoint, "load", _load)
    assert doctors() == ("acme", "acmes")
    broken, first, second = diagnose("acme", MachineContext())
    assert (first.verdict, first.what) == ("ok", "first")
    assert (second.verdict, second.what) == ("failed", "acme: the bus is gone")
    assert broken.verdict == "failed"
    assert "doctor 'acme' (no_such_module:checks of acme 1) cannot be imported" in broken.what


def _load(entry: EntryPoint) -> Any:
    if entry.value.startswith(__name__):
        return fails
    raise ImportError("no such module")


def test_a_scan_of_a_backend_that_is_not_installed_says_how_to_install_it() -> None:
    with pytest.raises(PluginError, match="robotd-acme is not installed: pip install robotd-acme"):
        scan_network("acme", {}, "pip install robotd-acme")


@pytest.mark.parametrize(("options", "text"), [({}, "channel=can0"), ({"bitrate": "x"}, "channel")])
def test_a_scan_without_a_bus_says_what_to_name(options: dict[str, str], text: str) -> None:
    with pytest.raises(InvalidArgument, match=text):
        scan(options)
    with pytest.raises(InvalidArgument, match="interface=eth1"):
        scan_network("ethercat", {}, "")


def link(**values: Any) -> dict[str, Any]:
    return {"flags": ["UP"], "linkinfo": {"info_data": values}}


@pytest.mark.parametrize(
    ("details", "verdict", "text"),
    [
        ({"flags": []}, "failed", "can7 is down"),
        (link(state="BUS-OFF"), "failed", "BUS-OFF"),
        (link(state="ERROR-ACTIVE", bittiming={"bitrate": 500000}), "ok", "500000 bit/s"),
    ],
)
def test_a_can_interface_is_judged(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    details: dict[str, Any],
    verdict: str,
    text: str,
) -> None:
    (tmp_path / "can7").mkdir()
    (tmp_path / "can7" / "type").write_text(machine_check.ARPHRD_CAN)
    monkeypatch.setattr(machine_check, "NETWORK", tmp_path)
    monkeypatch.setattr(machine_check, "_details", lambda _: details)
    found = [*machine_check.checks(MachineContext())]
    assert any(finding.verdict == verdict and text in finding.what for finding in found), found


@pytest.mark.parametrize(
    ("queue", "verdict", "text"),
    [
        (("pfifo_fast", 0), "warning", "keeps the oldest frames while the bus is blocked"),
        (("pfifo_head_drop", 1000), "warning", "queues 1000 frames; one period has 15"),
        (("pfifo_head_drop", 14), "warning", "queues 14 frames; one period has 15"),
        (("pfifo_head_drop", 30), "ok", "queues 30 frames, and drops the oldest"),
    ],
)
def test_a_queue_keeps_no_frames_of_the_past(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    queue: tuple[str, int],
    verdict: str,
    text: str,
) -> None:
    """The arm has twelve RPDOs, and one of its I/O module, SYNC and heartbeat."""
    (tmp_path / "can7").mkdir()
    (tmp_path / "can7" / "type").write_text(machine_check.ARPHRD_CAN)
    monkeypatch.setattr(machine_check, "NETWORK", tmp_path)
    monkeypatch.setattr(machine_check, "_details", lambda _: link())
    monkeypatch.setattr(machine_check, "_queueing", lambda _: queue)
    overrides = [parse_override("backends.canopen.bus.channel=can7")]
    robot = load_robot_descriptor("cr3a", overrides=overrides)
    [found] = [
        check for check in machine_check.checks(MachineContext((robot,))) if "frames" in check.what
    ]
    assert (found.verdict, text in found.what) == (verdict, True), found
    if verdict == "warning":
        assert found.advice == "sudo tc qdisc replace dev can7 root pfifo_head_drop limit 30"


@pytest.mark.parametrize(("interface", "warned"), [("slcan", True), ("kvaser", False)])
def test_an_adapter_that_keeps_unsent_frames_is_named(interface: str, warned: bool) -> None:
    keys = {"interface": interface, "channel": "adapter"}
    overrides = [parse_override(f"backends.canopen.bus.{key}={keys[key]}") for key in keys]
    robot = load_robot_descriptor("cr3a", overrides=overrides)
    found = [*machine_check.checks(MachineContext((robot,)))]
    text = f"{interface} cannot discard frames"
    assert any(text in finding.what for finding in found) is warned, found


def test_a_channel_that_is_not_there_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(machine_check, "NETWORK", tmp_path)
    overrides = [parse_override("backends.canopen.bus.channel=can9")]
    robot = load_robot_descriptor("cr3a", overrides=overrides)
    found = [*machine_check.checks(MachineContext((robot,)))]
    assert any(finding.verdict == "failed" and "'can9'" in finding.what for finding in found), found


@pytest.mark.parametrize(
    ("variables", "text"),
    [
        ({"ROS_DOMAIN_ID": "150"}, "ROS_DOMAIN_ID is '150'"),
        ({"ROS_DOMAIN_ID": "-1"}, "ROS_DOMAIN_ID is '-1'"),
        ({"RMW_IMPLEMENTATION": "rmw_zenoh_cpp"}, "rmw_zenoh_cpp', which is not installed"),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}, "discovery range OFF"),
        ({"ROS_STATIC_PEERS": "no-such-host.invalid"}, "no-such-host.invalid"),
        ({"ROS_DISCOVERY_SERVER": "no-such-host.invalid:11811"}, "no-such-host.invalid"),
    ],
)
def test_settings_by_which_no_robot_is_found_fail(
    monkeypatch: pytest.MonkeyPatch, variables: dict[str, str], text: str
) -> None:
    for name in ("ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    found = [*network_checks.check_network(MachineContext())]
    assert any(finding.verdict == "failed" and text in finding.what for finding in found), found


def test_the_router_of_zenoh_is_looked_for_where_sessions_do(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def found(override: str = "", **variables: str) -> tuple[str, str]:
        finding = zenoh_router({"ZENOH_CONFIG_OVERRIDE": override, **variables})
        return finding.verdict, finding.what

    with socket.create_server(("127.0.0.1", 0)) as router:
        address = f"tcp/127.0.0.1:{router.getsockname()[1]}"
        override = f'mode="client";connect/endpoints=["tcp/127.0.0.1:1", "{address}"]'
        assert found(override) == ("ok", f"a Zenoh router is at {address}")
        monkeypatch.setattr(zenoh_check, "ROUTER", address)
        assert found()[0] == "ok"
    assert found(override)[0] == "failed"
    assert found() == ("failed", f"no Zenoh router at {address}: no process finds another one")
    assert found("scouting/multicast/enabled=true")[0] == "ok"
    assert "not checked" in found(ZENOH_SESSION_CONFIG_URI="/etc/session.json5")[1]


def test_interrupts_on_isolated_cores_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "isolated").write_text("2-3")
    for number, cores in (("16", "0-1"), ("17", "0-3"), ("18", "3")):
        (tmp_path / number).mkdir()
        (tmp_path / number / "smp_affinity_list").write_text(cores)
    monkeypatch.setattr(computer_checks, "CPUS", tmp_path)
    monkeypatch.setattr(computer_checks, "IRQS", tmp_path)
    [found] = computer_checks._interrupts()
    assert found.verdict == "warning"
    assert found.what.startswith("2 interrupts may run on isolated cores")


def test_ports_that_other_computers_reach_are_found(tmp_path: Path) -> None:
    table = tmp_path / "tcp"
    table.write_text(
        "  sl  local_address rem_address   st\n"
        "   0: 00000000:0016 00000000:0000 0A\n"
        "   1: 0100007F:1F90 00000000:0000 0A\n"
        "   2: 0200A8C0:1F91 0300A8C0:0000 01\n"
        "   3: 3500007F:0035 00000000:0000 0A\n"  # 127.0.0.53 of systemd-resolved
        "   4: 0000000000000000FFFF00000100007F:0277 00000000000000000000000000000000:0000 0A\n"
        "   5: 00000000000000000000000001000000:0278 00000000000000000000000000000000:0000 0A\n"
        "   6: 0000000000000000FFFF00000200A8C0:0050 00000000000000000000000000000000:0000 0A\n"
    )
    assert [*network_checks._open_ports(table)] == [22, 80]
