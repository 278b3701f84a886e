"""Default command, ROS arguments, and what becomes of an error."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import Result

from robotd.cli.exit_codes import ExitCode, RosUnavailable, exit_code
from robotd.cli.group import ROS_ARGS
from robotd.cli.main import main
from robotd.cli.plugin_commands import plugin_commands
from robotd.errors import (
    ConnectError,
    DescriptorError,
    DeviceTimeout,
    InvalidArgument,
    NotReady,
    OperationError,
    PluginError,
    RecordingError,
    RobotdError,
    Unsupported,
)
from robotd_ros.commands.robot_client import ROS_EPILOG

Robotd = Callable[..., Result]


@pytest.fixture
def ran(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Arguments of ``robotd run``, recorded instead of running it."""
    seen: list[Any] = []

    def run_robot(options: Any) -> int:
        seen.append(options)
        return 0

    monkeypatch.setattr("robotd.cli.run_command.run_robot", run_robot)
    return seen


@pytest.fixture
def raising(monkeypatch: pytest.MonkeyPatch) -> Callable[[BaseException], None]:
    """Make ``robotd run`` raise."""

    def prepare(error: BaseException) -> None:
        def run_robot(options: Any) -> int:
            raise error

        monkeypatch.setattr("robotd.cli.run_command.run_robot", run_robot)

    return prepare


def test_without_arguments_it_explains_itself(robotd: Robotd) -> None:
    result = robotd()
    assert result.output.startswith("Usage: robotd")
    for command in ("run", "check", "robots", "backends", "nodes"):
        assert f"  {command} " in result.output


@pytest.mark.parametrize("words", [["run"], []])
def test_run_is_the_default_command(robotd: Robotd, ran: list[Any], words: list[str]) -> None:
    result = robotd(*words, "--robot", "cr3a", "--backend", "sim", "--nodes", "a, b,a")
    assert result.exit_code == 0, result.output
    (options,) = ran
    assert (options.robot, options.backend, options.variant) == ("cr3a", "sim", None)
    assert options.nodes == ["a", "b"]
    assert options.rate_hz is None
    assert options.ros_args == []


def test_an_option_with_an_equals_sign_finds_the_default_command_too(
    robotd: Robotd, ran: list[Any]
) -> None:
    assert robotd("--robot=cr3a", "--rate=250").exit_code == 0
    assert ran[0].rate_hz == 250.0


def test_what_follows_ros_args_is_left_as_it_is(robotd: Robotd, ran: list[Any]) -> None:
    ros = ["--ros-args", "-r", "__ns:=/left", "--log-level", "warn", "--robot", "x", "--", "--help"]
    result = robotd("--robot", "cr3a", *ros)
    assert result.exit_code == 0, result.output
    assert ran[0].ros_args == ros
    assert ran[0].robot == "cr3a"


def test_ros_args_alone_are_a_run_without_a_robot(robotd: Robotd, ran: list[Any]) -> None:
    result = robotd("--ros-args", "-r", "a:=b")
    assert result.exit_code == ExitCode.USAGE
    assert "Missing option '--robot'" in result.output
    assert ran == []


@pytest.mark.parametrize("command", ["check", "robots", "nodes"])
def test_commands_without_ros_take_no_ros_args(robotd: Robotd, command: str) -> None:
    result = robotd(command, "--ros-args", "-r", "a:=b")
    assert result.exit_code == ExitCode.USAGE
    assert f"{command} takes no --ros-args" in result.output


def test_every_command_for_a_running_robot_takes_ros_args() -> None:
    context = click.Context(main)
    names = [listed.name for listed in plugin_commands()]
    commands = {name: main.get_command(context, name) for name in names}
    clients = {
        name for name, command in commands.items() if command and command.epilog == ROS_EPILOG
    }
    assert ROS_ARGS in ROS_EPILOG
    assert {"stop", "move", "status", "record"} <= clients


def test_the_help_shows_no_limits_where_there_are_none(robotd: Robotd) -> None:
    assert "x<=None" not in robotd("canopen", "scan", "--help").output


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["walk"], "No such command 'walk'."),
        (["statuss"], "No such command 'statuss'; did you mean 'status'?"),
        (["help"], "No such command 'help'; robotd --help lists the commands"),
        (["start"], "No such command 'start'; robotd run --robot NAME serves a robot"),
        (["cr3a"], "No such command 'cr3a'; it is a robot: robotd run --robot cr3a"),
        (["run", "cr3a"], "a robot is an option: --robot cr3a"),
        (
            ["status", "--namespace", "left", "--ros-args", "-r", "__ns:=/left"],
            "--namespace and __ns:= give the same: leave one out",
        ),
        (["--robt", "cr3a"], "No such option '--robt'"),
        (["--robot", "cr3a", "--rate", "9.9"], "9.9 is not in the range 10<=x<=2000"),
        (["--robot", "cr3a", "--rate", "nan"], "'--rate'"),
        (["--robot", "cr3a", "--nodes", ","], "no name given"),
        (["--robot", "cr3a", "--log-level", "loud"], "'loud' is not one of 'debug'"),
    ],
)
def test_a_wrong_command_line_is_status_2(
    robotd: Robotd, ran: list[Any], words: list[str], text: str
) -> None:
    result = robotd(*words)
    assert result.exit_code == ExitCode.USAGE
    assert text in result.stderr
    assert ran == []


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (DescriptorError("x"), 3),
        (RecordingError("x"), 3),
        (InvalidArgument("x"), 3),
        (PluginError("x"), 4),
        (ConnectError("x"), 5),
        (DeviceTimeout("x"), 5),
        (OperationError("x"), 5),
        (NotReady("x"), 5),
        (Unsupported("x", "y"), 5),
        (RosUnavailable("x"), 6),
        (RobotdError("x"), 1),
        (KeyError("x"), 1),
    ],
)
def test_each_phase_has_its_exit_status(error: Exception, code: int) -> None:
    assert exit_code(error) == code


def test_control_characters_of_an_error_are_escaped(robotd: Robotd, tmp_path: Path) -> None:
    file = tmp_path / "a\x1b[2J\x07.mcap"
    result = robotd("explain", str(file))
    assert "\x1b" not in result.stderr
    assert r"a\x1b[2J\x07.mcap" in result.stderr


def test_ctrl_c_during_the_imports_prints_no_traceback() -> None:
    program = """
import os, signal, sys
class Interrupting:
    def find_spec(self, name, *_):
        if name == "click":
            os.kill(os.getpid(), signal.SIGINT)
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.meta_path.insert(0, Interrupting())
from robotd.cli import main
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False, timeout=60
    )
    assert (done.returncode, done.stderr) == (-signal.SIGINT, "")


def test_an_error_is_one_sentence_on_standard_error(
    robotd: Robotd, raising: Callable[[BaseException], None]
) -> None:
    raising(ConnectError("bus is dead", {"can0": "no carrier"}))
    result = robotd("--robot", "cr3a")
    assert result.exit_code == ExitCode.DEVICE
    assert result.stderr == "robotd: error: bus is dead\n  can0: no carrier\n"
    assert result.stdout == ""


def test_an_internal_error_is_admitted_without_a_traceback(
    robotd: Robotd, raising: Callable[[BaseException], None]
) -> None:
    raising(KeyError("axis"))
    result = robotd("--robot", "cr3a")
    assert result.exit_code == ExitCode.FAILED
    assert result.stderr.startswith("robotd: error: internal error: KeyError: 'axis'\n")
    assert "Traceback" not in result.stderr


@pytest.mark.parametrize("error", [KeyError("axis"), PluginError("axis")])
def test_debug_shows_the_traceback_too(
    robotd: Robotd, raising: Callable[[BaseException], None], error: Exception
) -> None:
    raising(error)
    result = robotd("--robot", "cr3a", "--log-level", "debug")
    assert result.stderr.startswith("Traceback (most recent call last):")
    assert "robotd: error: " in result.stderr


def test_an_interrupt_is_no_error(robotd: Robotd, raising: Callable[[BaseException], None]) -> None:
    raising(KeyboardInterrupt())
    result = robotd("--robot", "cr3a")
    assert result.exit_code == ExitCode.INTERRUPTED
    assert "Traceback" not in result.output


def test_help_waits_for_no_heavy_module() -> None:
    program = (
        "import sys, robotd.cli\n"
        "heavy = {'numpy', 'scipy', 'pydantic', 'lxml', 'structlog', 'rclpy'}\n"
        "print(*sorted(heavy & set(sys.modules)))"
    )
    result = subprocess.run(
        [sys.executable, "-c", program], check=True, capture_output=True, text=True, timeout=30
    )
    assert result.stdout == "\n"


def test_the_listed_summaries_are_those_of_the_commands() -> None:
    context = click.Context(main)
    for _, name, summary in plugin_commands():
        command = main.get_command(context, name)
        assert command is not None
        assert command.name == name
        assert (command.help or "").splitlines()[0] == summary


@pytest.mark.parametrize("words", [["nodes"], ["--help"]])
def test_output_on_a_full_disk_is_no_internal_error(words: list[str]) -> None:
    with Path("/dev/full").open("wb") as full:
        command = [sys.executable, "-m", "robotd", *words]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr == "robotd: error: the output cannot be written: No space left on device\n"


def test_a_closed_pipe_ends_a_command_quietly() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "wb") as closed:
        command = [sys.executable, "-u", "-m", "robotd", "nodes"]
        done = subprocess.run(
            command, stdout=closed, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == 1
    assert done.stderr == ""


def test_no_summary_of_a_command_is_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")

    def helps(group: click.Group, *names: str) -> Iterator[str]:
        context = click.Context(group, info_name=" ".join(names))
        yield group.get_help(context).partition("Commands:")[2]
        for name in group.list_commands(context):
            command = group.get_command(context, name)
            if isinstance(command, click.Group):
                yield from helps(command, *names, name)

    assert isinstance(main, click.Group)
    found = [*helps(main, "robotd")]
    assert len(found) > len(("robotd", "canopen", "ethercat", "sim", "tool"))
    assert [text for text in found if "..." in text] == []
