"""The commands for a running robot, up to the point where they need one."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator

import pytest
from click.testing import Result

from robotd.cli.exit_codes import ExitCode
from robotd.stop_signals import Interrupt
from robotd_ros.commands.goal import ProgressLine

Robotd = Callable[..., Result]


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["move"], "Missing argument 'JOINT=POSITION...'"),
        (["move", "joint1"], "'joint1' is not like joint1=0.5"),
        (["move", "=1"], "'=1' is not like joint1=0.5"),
        (["move", "joint1=far"], "joint1: 'far' is not a number"),
        (["move", "joint1=nan"], "joint1: 'nan' is not a number"),
        (["move", "joint1=inf"], "joint1: 'inf' is not a number"),
        (["move", "joint1=0", "joint1=1"], "joint1 is given twice"),
        (["move", "joint1=0", "--time", "0"], "0.0 is not in the range"),
        (["move", "joint1=0", "--time", "nan"], "nan is not a number"),
        (["move", "joint1=0", "--timeout", "nan"], "nan is not a number"),
        (["jog", "joint1"], "Missing argument '±INCREMENT'"),
        (["jog", "joint1", "far"], "'far' is not a valid number."),
        (["jog", "joint1", "-inf"], "-inf is not a finite number"),
        (["jog", "joint1", "-0.1", "--speed", "0"], "0.0 is not in the range"),
        (["sdo", "write", "1", "0x2000", "0", str(1 << 63)], "is outside -2^63 .. 2^63 - 1"),
        (["record", "--time", "nan"], "nan is not a number"),
        (["speed", "101"], "101.0 is not in the range"),
        (["speed", "nan"], "nan is not a number"),
        (["gripper", "squeeze"], "'squeeze' is not one of 'open', 'close'"),
        (["move", "joint1=0", "--action", ""], "the word after '--action' is empty"),
        (["move", "joint1=0", "--action="], "'--action' has an empty value"),
        (["--robot", "cr3a", "--backend", ""], "the word after '--backend' is empty"),
        (["explain", ""], "the word after 'explain' is empty"),
        (["explain", "--", ""], "'' is neither a file nor a number"),
        (["", "status"], "the word after 'robotd' is empty"),
        (["move", "joint1=1_0"], "joint1: '1_0' is not a number"),
        (["move", "joint1=1", "--time", "1_0"], "'1_0' is not a number"),
        (["jog", "joint1", "1_0"], "'1_0' is not a number"),
        (["speed", "1_0"], "'1_0' is not a number"),
        (["sim", "step", "1_0"], "'1_0' is not a number"),
        (["sdo", "read", "1", "0x20_00"], "'0x20_00' is not a number"),
        (["sdo", "write", "1", "0x2000", "0", "1", "--size", "1_0"], "'1_0' is not a number"),
        (["canopen", "sdo", "read", "1", "0x20_00"], "'0x20_00' is not a number"),
        (["canopen", "scan", "--bitrate", "500_000"], "'500_000' is not a number"),
        (["ethercat", "sdo", "read", "1_0", "0x2000"], "'1_0' is not a number"),
        (["--robot", "cr3a", "--time-scale", "1_0"], "'1_0' is neither max nor a number"),
        (["explain", "86_11"], "'86_11' is neither a file nor a number"),
        (["servo", "on", "-1"], "No such option '-1'"),
        (["status", "--watch"], "--watch needs a terminal"),
        (["list", "--watch"], "--watch needs a terminal"),
        (["list", "--watch", "--json"], "--watch and --json exclude each other"),
    ],
)
def test_a_wrong_command_line_is_status_2(robotd: Robotd, words: list[str], text: str) -> None:
    result = robotd(*words)
    assert result.exit_code == ExitCode.USAGE
    assert text in result.stderr


def test_the_first_interrupt_is_noted_and_the_second_one_raises() -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background ignores it
    with Interrupt() as interrupt:
        assert not interrupt.happened
        os.kill(os.getpid(), signal.SIGINT)
        assert interrupt.happened
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.fixture(params=[signal.SIGHUP, signal.SIGQUIT])
def optional(request: pytest.FixtureRequest) -> Iterator[signal.Signals]:
    """A signal that a parent can have the process ignore."""
    before = signal.signal(request.param, signal.SIG_DFL)
    yield request.param
    signal.signal(request.param, before)


def test_a_hangup_and_a_quit_are_noted_unless_they_are_ignored(optional: signal.Signals) -> None:
    with Interrupt() as interrupt:
        os.kill(os.getpid(), optional)
        assert interrupt.happened
    assert signal.getsignal(optional) is signal.SIG_DFL
    signal.signal(optional, signal.SIG_IGN)  # SIGHUP: as nohup does
    with Interrupt() as interrupt:
        os.kill(os.getpid(), optional)
        assert not interrupt.happened


def test_what_follows_a_hangup_is_no_second_signal() -> None:
    """The kernel and the shell send one each, and the session manager SIGTERM."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    try:
        with Interrupt() as interrupt:
            for number in (signal.SIGHUP, signal.SIGHUP, signal.SIGTERM):
                os.kill(os.getpid(), number)
            assert interrupt.happened
            assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    finally:
        signal.signal(signal.SIGHUP, before)


def test_progress_is_one_line_on_a_terminal_and_nothing_elsewhere(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    progress = ProgressLine(["joint1"], 2.0, degrees={"joint1"})
    progress.show(1.0, {"joint1": 0.5, "joint2": 0.0})
    progress.end()
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    progress.show(1.0, {"joint1": 0.5, "joint2": 0.0})
    assert "1.0 of 2.0 s  joint1 +28.6°" in capsys.readouterr().err
    progress.end()
    assert "joint1" not in capsys.readouterr().err
