"""``robotd check`` finds what EDS files, PDOs and the bus load say."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from robotd.cli import main
from robotd.cli.exit_codes import ExitCode


def check(*arguments: str) -> Result:
    return CliRunner().invoke(main, ["check", "--backend", "canopen", *arguments])


@pytest.mark.parametrize("robot", ["cr3a", "baymax"])
@pytest.mark.parametrize(
    "arguments",
    [
        ("--set", "backends.canopen.bus.channel=can0"),
        ("--variant", "canopen_simulated"),
        ("--variant", "canopen_multicast"),
    ],
)
def test_the_robots_that_come_with_robotd_are_well(robot: str, arguments: tuple[str, str]) -> None:
    result = check("--robot", robot, *arguments)
    assert result.exit_code == 0, result.output
    assert result.stdout.splitlines()[-1] == "all checks passed"


@pytest.mark.parametrize("robot", ["cr3a", "baymax"])
def test_a_bus_must_be_named(robot: str) -> None:
    result = check("--robot", robot)
    assert result.exit_code == ExitCode.CONFIGURATION
    assert "backends.canopen.bus.channel: missing: name the CAN bus, for example" in result.stdout


def test_every_problem_of_the_network_is_told(tmp_path: Path) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text(
        """\
schema: 1
name: wrong
axes: 2
backends:
  canopen:
    bus: {bitrate: 125000}
    axis_defaults: {counts_per_rad: 1000.0}
    axes:
      - {axis: 0, node: 1, eds: nowhere.eds}
      - {axis: 1, node: 2, startup: [{object: "0x7777", value: 1}]}
""",
        encoding="utf-8",
    )
    result = check("--robot", str(path))
    assert result.exit_code == ExitCode.CONFIGURATION
    for text in (
        "backends.canopen.axes.0.eds:",
        "backends.canopen.axes.1.startup.0: 0x7777:00 is not in the EDS",
        "backends.canopen.sync_period_s: a SYNC each 0.002 s loads the bus of 125000 bit/s",
    ):
        assert text in result.stdout
