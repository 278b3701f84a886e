"""Commands that plugins bring: listed without an import, imported when they are called."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import Result

from robotd.cli.exit_codes import ExitCode
from robotd.cli.plugin_commands import COMMANDS

Robotd = Callable[..., Result]
Install = Callable[..., Path]

WAVE = """
    import click
    from robotd.errors import ConnectError

    @click.command()
    @click.option("--to")
    def wave(to):
        if to is None:
            raise ConnectError("nobody is there")
        click.echo(f"hello {to}")
"""


@pytest.fixture
def command(install: Install) -> Callable[..., Path]:
    """``command(name, source)``: a distribution that brings the command ``name``."""

    def make(name: str, source: str = WAVE, *, distribution: str = "acme") -> Path:
        site = install(name, source, distribution=distribution, group=COMMANDS)
        [announced] = site.glob("*.dist-info/entry_points.txt")
        announced.write_text(f"[{COMMANDS}]\n{name} = plugin_{distribution}:wave\n", "utf-8")
        return site

    return make


def test_a_command_runs_with_its_own_options(robotd: Robotd, command: Callable[..., Path]) -> None:
    command("wave")
    result = robotd("wave", "--to", "all")
    assert (result.exit_code, result.stdout) == (0, "hello all\n")


def test_its_errors_are_told_as_those_of_robotd(
    robotd: Robotd, command: Callable[..., Path]
) -> None:
    command("wave")
    result = robotd("wave")
    assert result.exit_code == ExitCode.DEVICE
    assert result.stderr == "robotd: error: nobody is there\n"


def test_help_lists_it_and_imports_nothing(robotd: Robotd, command: Callable[..., Path]) -> None:
    command("wave")
    result = robotd("--help")
    assert "Commands of plugins:" in result.stdout
    assert "wave" in result.stdout
    assert "of acme 1.2" in result.stdout
    assert "plugin_acme" not in sys.modules


def test_other_commands_do_not_import_it(robotd: Robotd, command: Callable[..., Path]) -> None:
    command("wave", "raise SystemExit")
    assert robotd("nodes").exit_code == 0


def test_robotds_own_commands_cannot_be_replaced(
    robotd: Robotd, command: Callable[..., Path]
) -> None:
    command("nodes", "raise SystemExit")
    assert "wmx_engine_node" in robotd("nodes").stdout


@pytest.mark.parametrize(
    ("source", "text"),
    [
        ("import nonsense", "cannot be imported: ModuleNotFoundError"),
        ("raise SystemExit(3)", "cannot be imported: SystemExit: 3"),
        ("", "cannot be imported: AttributeError"),
        ("wave = 3", "is not a click command: int"),
    ],
)
def test_a_broken_one_is_told_by_its_distribution(
    robotd: Robotd, command: Callable[..., Path], source: str, text: str
) -> None:
    command("wave", source)
    result = robotd("wave")
    assert result.exit_code == ExitCode.PLUGIN
    assert f"command 'wave' (plugin_acme:wave of acme 1.2) {text}" in result.stderr


def test_two_of_one_name_are_rejected(robotd: Robotd, command: Callable[..., Path]) -> None:
    command("wave")
    command("wave", distribution="zenith")
    result = robotd("wave")
    assert result.exit_code == ExitCode.PLUGIN
    origins = [f"'wave' (plugin_{package}:wave of {package} 1.2)" for package in ("acme", "zenith")]
    for one, other in (origins, origins[::-1]):
        assert f"command {one}: the name 'wave' is taken by {other}" in result.stderr


@pytest.mark.parametrize("error", ["KeyError('bus')", "FileNotFoundError(2, 'No such file', 'x')"])
def test_a_command_that_raises_names_its_plugin(
    robotd: Robotd, command: Callable[..., Path], error: str
) -> None:
    command("wave", WAVE.replace('ConnectError("nobody is there")', error))
    result = robotd("wave")
    assert result.exit_code == ExitCode.PLUGIN
    name = error.partition("(")[0]
    assert f"command 'wave' (plugin_acme:wave of acme 1.2) failed: {name}: " in result.stderr
    assert "(plugin_acme.py:9)" in result.stderr
    assert result.stderr.endswith("please report it to the authors of acme 1.2\n")
