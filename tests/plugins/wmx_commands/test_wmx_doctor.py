"""``robotd wmx doctor`` without SDK and backend, on SDKs that are made up."""

from __future__ import annotations

import platform
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import Result

from robotd.cli.exit_codes import ExitCode
from robotd.descriptor import load_robot_descriptor
from robotd_wmx_commands import machine_checks
from robotd_wmx_commands.cli import slave_lines
from robotd_wmx_commands.machine_checks import Finding, check_cores, check_eni, check_sdk
from robotd_wmx_parameters import parameter_warnings, read_wmx_parameters

Robotd = Callable[..., Result]
ELF = (
    b"\x7fELF"
    + bytes(14)
    + machine_checks.ELF_MACHINES.get(platform.machine(), 0).to_bytes(2, "little")
)


@pytest.fixture
def sdk(tmp_path: Path) -> Path:
    """Files of a complete SDK with cyclic buffers, without content."""
    for folder in ("include", "lib"):
        (tmp_path / folder).mkdir()
    for header in (*machine_checks.HEADERS, "CyclicBufferApi.h"):
        (tmp_path / "include" / header).touch()
    for library in (*machine_checks.LIBRARIES, machine_checks.CYCLIC_LIBRARY):
        (tmp_path / "lib" / f"lib{library}.so").write_bytes(ELF)
    return tmp_path


@pytest.fixture
def not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The backend is not there, although a test before may have imported it from its folder."""
    for name in [name for name in sys.modules if f"{name}.".startswith("robotd_wmx.")]:
        monkeypatch.delitem(sys.modules, name)


def bad(findings: list[Finding]) -> list[str]:
    return [finding.what for finding in findings if finding.verdict != "ok"]


@pytest.mark.usefixtures("not_installed")
def test_a_known_backend_that_is_not_installed_is_named_with_its_remedy(robotd: Robotd) -> None:
    result = robotd("--robot", "cr3a", "--backend", "wmx")
    assert result.exit_code == ExitCode.PLUGIN
    assert "backend 'wmx' is not installed; 'robotd wmx doctor' shows" in result.output


@pytest.mark.usefixtures("not_installed")
def test_the_doctor_runs_without_sdk_and_backend(robotd: Robotd, tmp_path: Path) -> None:
    result = robotd("wmx", "doctor", "--sdk", str(tmp_path / "nothing"))
    assert result.exit_code == 1
    assert f"no SDK at {tmp_path / 'nothing'}" in result.output
    assert "the backend robotd-wmx is not installed" in result.output
    assert "cr3a: wmx_parameters.xml read, 6 axes" in result.output
    assert "QuickStopDec of 100000 rad/s²" in result.output


@pytest.mark.usefixtures("not_installed")
def test_a_scan_without_the_backend_says_how_to_install_it(robotd: Robotd) -> None:
    result = robotd("wmx", "scan")
    assert result.exit_code == ExitCode.PLUGIN
    assert "pip install ./plugins/wmx" in result.output


def test_slaves_are_shown_a_line_each() -> None:
    slave = {
        "master": 0, "slave": 3, "axes": 1, "vendor_id": 0x1234, "product_code": 0xAB,
        "revision": 1, "serial": 77, "state": "Op", "modes": ["CSP", "CSV"],
    }  # fmt: skip
    line, count = slave_lines({"slaves": [slave]})
    assert line == (
        "master 0 slave   3: 1 axes, vendor 0x00001234, product 0x000000AB,"
        " revision 0x00000001, serial 77, Op; CSP CSV"
    )
    assert count == "1 slave"
    assert [*slave_lines({"slaves": []})] == ["0 slaves"]


def test_a_complete_sdk_is_ok(sdk: Path) -> None:
    assert bad(list(check_sdk(sdk))) == []


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", "is empty"),
        (b"<html>", "is neither a shared library nor an archive"),
        (b"\x7fELF" + bytes(14) + b"\x08\x00", "is not for"),
    ],
)
def test_a_library_that_is_none_fails(sdk: Path, content: bytes, problem: str) -> None:
    (sdk / "lib" / "libioapi.so").write_bytes(content)
    [found] = bad(list(check_sdk(sdk)))
    assert f"libioapi.so {problem}" in found


def test_missing_headers_and_cyclic_buffers_are_named(sdk: Path) -> None:
    (sdk / "include" / "EcApi.h").unlink()
    (sdk / "lib" / "libcyclicbufferapi.so").unlink()
    header, cyclic = bad(list(check_sdk(sdk)))
    assert "no header EcApi.h" in header
    assert "no cyclic buffers" in cyclic


def test_an_eni_file_is_found(sdk: Path) -> None:
    assert "no ENI file" in bad(list(check_eni(sdk)))[0]
    (sdk / "platform").mkdir()
    (sdk / "platform" / "net.xml").write_text("<?xml version='1.0'?><EtherCATConfig/>")
    assert bad(list(check_eni(sdk))) == []


def test_isolated_cores_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    isolated = tmp_path / "isolated"
    monkeypatch.setattr(machine_checks, "ISOLATED", isolated)
    isolated.write_text("\n")
    assert "is isolated" in bad(list(check_cores(tmp_path)))[0]
    isolated.write_text("2-3\n")
    assert bad(list(check_cores(tmp_path))) == []


def test_sound_parameters_have_no_warning() -> None:
    robot = load_robot_descriptor("cr3a")
    assert robot.parameters_file is not None
    parameters = read_wmx_parameters(robot.parameters_file, robot.axes)
    axes = range(robot.axes)
    sound = parameters.with_values(
        {
            "QuickStopDec": dict.fromkeys(axes, 25.0),
            "FollowingErrorType": dict.fromkeys(axes, 1),
            "FollowingErrorMoving": dict.fromkeys(axes, 0.2),
            "FollowingErrorStopped": dict.fromkeys(axes, 0.05),
        }
    )
    assert parameter_warnings(sound, robot) == []
    steep = sound.with_values({"QuickStopDec": {2: 1e5}})
    [warning] = parameter_warnings(steep, robot)
    assert warning.startswith("joint3: QuickStopDec of 100000 rad/s²")
    assert "25.1 rad/s²" in warning
