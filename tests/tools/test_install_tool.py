"""``tools.install`` gives uv the settings of pip, and lets pip install where uv cannot."""

from __future__ import annotations

import itertools
import subprocess
import sys
import zipfile
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path

import pytest
from tools import install as install_tool

LISTING = """\
:env:.index-url='https://user:secret@mirror.example/simple'
:env:.trusted-host='mirror.example other.example'
global.cert='/etc/ssl/company.pem'
global.extra-index-url='file:///srv/a/simple\\nfile:///srv/b/simple'
global.find-links='/srv/wheels'
global.index-url='https://pypi.example/simple'
install.find-links='/srv/newer'
wheel.find-links='/srv/other'
"""


def test_the_environment_overrides_the_section_install_overrides_global() -> None:
    assert install_tool.read_pip_settings(LISTING) == {
        "cert": "/etc/ssl/company.pem",
        "extra-index-url": "file:///srv/a/simple\nfile:///srv/b/simple",
        "find-links": "/srv/newer",
        "index-url": "https://user:secret@mirror.example/simple",
        "trusted-host": "mirror.example other.example",
    }


def test_uv_installs_from_the_indexes_of_pip() -> None:
    settings = install_tool.read_pip_settings(LISTING)
    command = install_tool.uv_command(settings, ["--editable", "."])
    pairs = list(itertools.pairwise(command))
    for pair in (
        ("--default-index", "https://user:secret@mirror.example/simple"),
        ("--index", "file:///srv/a/simple"),
        ("--index", "file:///srv/b/simple"),
        ("--find-links", "/srv/newer"),
        ("--allow-insecure-host", "mirror.example"),
        ("--allow-insecure-host", "other.example"),
    ):
        assert pair in pairs
    assert command[-2:] == ["--editable", "."]
    assert "--no-index" not in command
    assert install_tool.uv_environment(settings) == {"SSL_CERT_FILE": "/etc/ssl/company.pem"}


@pytest.mark.parametrize(("value", "is_given"), [("1", True), ("true", True), ("0", False)])
def test_uv_uses_no_index_if_pip_uses_none(value: str, is_given: bool) -> None:
    assert ("--no-index" in install_tool.uv_command({"no-index": value}, [])) is is_given


def test_without_settings_uv_keeps_its_own() -> None:
    options = {*install_tool.OPTIONS.values(), "--no-index"}
    assert not options.intersection(install_tool.uv_command({}, ["robotd"]))
    assert install_tool.uv_environment({}) == {}


class Commands:
    """Replacement of ``subprocess.call`` that fails the commands of some programs."""

    def __init__(self, *failing: str) -> None:
        self.failing = failing
        self.programs: list[str] = []

    def __call__(self, command: Sequence[str], env: Mapping[str, str] | None = None) -> int:
        is_of_uv = install_tool.UV in command
        self.programs.append("get uv" if is_of_uv else command[command.index("-m") + 1])
        return int(self.programs[-1] in self.failing)


@pytest.mark.parametrize(
    ("is_there", "failing", "programs", "status"),
    [
        (True, (), ["uv"], 0),
        (False, (), ["get uv", "uv"], 0),
        (False, ("get uv",), ["get uv", "pip"], 0),
        (True, ("uv",), ["uv", "pip"], 0),
        (True, ("uv", "pip"), ["uv", "pip"], 1),
    ],
)
def test_pip_installs_what_uv_cannot(
    is_there: bool,
    failing: tuple[str, ...],
    programs: list[str],
    status: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    commands = Commands(*failing)
    monkeypatch.setattr(install_tool, "find_spec", lambda _: object() if is_there else None)
    monkeypatch.setattr(subprocess, "call", commands)
    monkeypatch.setattr(subprocess, "check_output", lambda *_, **__: "")
    assert install_tool.install(["--editable", "."]) == status
    assert commands.programs == programs


def make_wheel(folder: Path) -> None:
    info = "robotd_nothing-1.0.dist-info"
    with zipfile.ZipFile(folder / "robotd_nothing-1.0-py3-none-any.whl", "w") as wheel:
        wheel.writestr("robotd_nothing.py", "")
        wheel.writestr(
            f"{info}/METADATA", "Metadata-Version: 2.1\nName: robotd-nothing\nVersion: 1.0\n"
        )
        wheel.writestr(
            f"{info}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
        )
        wheel.writestr(
            f"{info}/RECORD",
            f"robotd_nothing.py,,\n{info}/METADATA,,\n{info}/WHEEL,,\n{info}/RECORD,,\n",
        )


@pytest.mark.parametrize("program", ["uv", "pip"])
def test_a_package_comes_from_the_folder_that_pip_is_set_to(
    program: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    if program == "uv" and find_spec("uv") is None:
        pytest.skip("no uv in this environment: an installed ROS needs none")
    if program == "pip":
        monkeypatch.setattr(install_tool, "has_uv", lambda: False)
    make_wheel(tmp_path)
    settings = tmp_path / "pip.conf"
    settings.write_text(f"[install]\nno-index = true\nfind-links = {tmp_path}\n", encoding="utf-8")
    monkeypatch.setenv("PIP_CONFIG_FILE", str(settings))
    monkeypatch.delenv("PIP_FIND_LINKS", raising=False)
    target = tmp_path / "target"
    assert install_tool.install(["--target", str(target), "robotd-nothing"]) == 0
    assert (target / "robotd_nothing.py").exists()
    assert ("pip installs" in capfd.readouterr().err) is (program == "pip")


def test_it_is_a_program() -> None:
    command = [sys.executable, "-m", "tools.install", "--help"]
    assert subprocess.run(command, check=False, capture_output=True).returncode == 0
