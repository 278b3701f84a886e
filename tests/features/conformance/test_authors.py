"""``robotd backends --check``, ``new-backend`` and ``conform`` for authors of backends."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from robotd.cli import main
from robotd.cli.exit_codes import ExitCode

Install = Callable[..., Path]

LYING = """
    from robotd.api import BackendInfo, Capability, hookimpl
    from tests.fakes import FakeAxes, FakeDevice

    @hookimpl
    def robotd_backend():
        return BackendInfo(
            summary="a test", api_version=1, capabilities=frozenset({Capability.HOT_CONNECT})
        )

    @hookimpl
    def robotd_open_device(): return FakeDevice()

    @hookimpl
    def robotd_axes(): return FakeAxes(2)
"""


def robotd(*arguments: str | Path) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def test_the_doctor_finds_the_simulation_well() -> None:
    result = robotd("backends", "--check", "sim")
    assert result.exit_code == 0
    assert "all checks passed" in result.output
    assert "fail" not in result.output


def test_the_doctor_names_the_nearest_backend() -> None:
    result = robotd("backends", "--check", "simm")
    assert result.exit_code == ExitCode.PLUGIN
    assert "did you mean 'sim'" in result.output


def test_the_doctor_finds_a_driver_that_was_declared_and_is_not_there(install: Install) -> None:
    install("lying", LYING)
    result = robotd("backends", "--check", "lying")
    assert result.exit_code == ExitCode.PLUGIN
    assert (
        "'hot_connect' is declared, but there is no FieldbusDriver for start_hot_connect()"
        in result.output
    )
    assert "'lying' (plugin_acme of acme 1.2)" in result.output
    assert "1 problem" in result.output


WRONG_ARGUMENTS = """
    from robotd.api import AxisDriver, BackendInfo, hookimpl
    from tests.fakes import FakeAxes, FakeDevice

    class Axes(FakeAxes):
        def servo(self, axis, on): pass
        def clear_alarm(self, axis, timeout_s, retries): pass
        def move(self, axis, profile, target): pass
        def quick_stop(self, axes, *, harder=True): pass
        def stop(self, *axes): pass
        def jog(self, axis, *, profile): pass
        def home(self, _axis, _timeout_s, method=37): pass
        def underrun(self): pass
        async def end_stream(self, axes): pass
        def follow(self, *args, **kwargs): pass

    @hookimpl
    def robotd_backend(): return BackendInfo(summary="a test", api_version=1)

    @hookimpl
    def robotd_open_device(): return FakeDevice()

    @hookimpl
    def robotd_axes(): return Axes(2)
"""


def test_the_doctor_compares_the_arguments_of_the_methods(install: Install) -> None:
    install("wrong", WRONG_ARGUMENTS)
    result = robotd("backends", "--check", "wrong")
    assert result.exit_code == ExitCode.PLUGIN
    found = [line.split("1.2): ")[1] for line in result.output.splitlines() if "Axes." in line]
    assert found == [
        (
            "Axes.clear_alarm needs 'retries', which it is not given;"
            " AxisDriver has clear_alarm(axis, timeout_s)"
        ),
        "Axes.end_stream is async or a generator: its body would not be run",
        "Axes.jog does not take 'profile' by position; AxisDriver has jog(axis, profile)",
        (
            "Axes.move takes 'profile' where it is given 'target';"
            " AxisDriver has move(axis, target, profile)"
        ),
        "Axes.servo does not take 'timeout_s'; AxisDriver has servo(axis, on, timeout_s)",
        "Axes.underrun is a method, and in AxisDriver it is none: add @property",
    ]
    assert "6 problems" in result.output


def test_the_doctor_goes_on_with_nothing_it_cannot_import(install: Install) -> None:
    install("broken", "import not_there_at_all")
    result = robotd("backends", "--check", "broken")
    assert result.exit_code == ExitCode.PLUGIN
    assert "ModuleNotFoundError" in result.output
    assert "robotd_open_device" not in result.output


def test_a_new_backend_has_one_file_per_contract(tmp_path: Path) -> None:
    result = robotd("new-backend", "my_bus", "--into", tmp_path)
    assert result.exit_code == 0
    package = tmp_path / "robotd-my-bus" / "robotd_my_bus"
    names = {path.stem for path in package.glob("*.py")}
    assert names >= {"__init__", "device", "axes", "io", "fieldbus", "options"}
    assert "class MyBusAxes(AxisDriver)" in (package / "axes.py").read_text(encoding="utf-8")
    for path in (tmp_path / "robotd-my-bus").rglob("*.*"):
        assert "$" not in path.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["My", "9bus", "my-bus", "", "a b", "../up"])
def test_a_name_that_is_none_is_rejected(name: str, tmp_path: Path) -> None:
    result = robotd("new-backend", "--into", tmp_path, "--", name)
    assert result.exit_code == ExitCode.CONFIGURATION
    assert not list(tmp_path.iterdir())


def test_a_taken_name_is_rejected(tmp_path: Path) -> None:
    result = robotd("new-backend", "sim", "--into", tmp_path)
    assert result.exit_code == ExitCode.CONFIGURATION
    assert "taken by 'sim'" in result.output


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    (tmp_path / "robotd-acme").mkdir()
    result = robotd("new-backend", "acme", "--into", tmp_path)
    assert result.exit_code == ExitCode.FAILED
    assert "exists already" in result.output


def test_the_checks_are_not_begun_for_a_backend_that_cannot_load() -> None:
    result = robotd("conform", "--backend", "simm")
    assert result.exit_code == ExitCode.PLUGIN
    assert "did you mean 'sim'" in result.output


@pytest.mark.parametrize("arguments", [("new-backend", "acme"), ("new-robot", "cell")])
def test_a_folder_that_cannot_be_written_is_named(arguments: tuple[str, str]) -> None:
    more = ("--extends", "cr3a") if arguments[0] == "new-robot" else ()
    result = robotd(*arguments, *more, "--into", "/proc")
    assert result.exit_code == ExitCode.FAILED
    assert result.stderr.startswith("robotd: error: folder /proc/")
