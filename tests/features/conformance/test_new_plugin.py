"""``robotd new-plugin``: each generated package is installed, checked and tested at once."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import Result

from robotd.cli.exit_codes import ExitCode
from robotd_conformance.new_plugin_command import KINDS, TAKEN

Robotd = Callable[..., Result]
ADDS = {
    "base": {"base": ["acme_x"]},
    "feature": {"feature": ["acme_x"], "key": ["acme_x"], "option": ["--acme-x/--no-acme-x"]},
    "node": {"node": ["acme_x"]},
    "robot": {"robot": ["acme_x"]},
}
LONG = pytest.mark.long  # each installs a package, and runs its tests
SETTINGS = Path(__file__).parents[3] / "pyproject.toml"


def run(*command: str | Path, cwd: Path, site: Path) -> str:
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTEST_")}
    done = subprocess.run(
        [sys.executable, "-m", *map(str, command)],
        cwd=cwd,
        env=environment | {"PYTHONPATH": str(site), "PIP_DISABLE_PIP_VERSION_CHECK": "1"},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_there_is_a_template_for_each_kind() -> None:
    assert {"backend", *ADDS} == KINDS.keys() == {"backend", *TAKEN}


@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    "kind", [kind if kind == "feature" else pytest.param(kind, marks=LONG) for kind in ADDS]
)
def test_a_generated_package_is_in_order(kind: str, robotd: Robotd, tmp_path: Path) -> None:
    made = robotd("new-plugin", kind, "acme_x", "--into", str(tmp_path))
    assert made.exit_code == 0, made.output
    package, site = tmp_path / "robotd-acme-x", tmp_path / "site"
    assert f"robotd plugins --check {package.name}" in made.output
    for path in package.rglob("*.*"):
        assert path.is_dir() or "$" not in path.read_text(encoding="utf-8"), path
    run(
        "ruff",
        "check",
        "--config",
        SETTINGS,
        "--ignore=D1,E402,I001,INP001,S",
        package,
        cwd=tmp_path,
        site=site,
    )
    run("ruff", "format", "--check", "--config", SETTINGS, package, cwd=tmp_path, site=site)
    offline = ("--no-index", "--no-deps", "--no-build-isolation", "--quiet")
    run("pip", "install", *offline, "--target", site, package, cwd=package, site=site)
    checked = run("robotd", "plugins", "--json", "--check", package.name, cwd=tmp_path, site=site)
    [found] = json.loads(checked)
    assert found["problems"] == []
    assert found["adds"] == ADDS[kind]
    run("pytest", "-q", "-p", "no:cacheprovider", "tests", cwd=package, site=site)


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("backend", "sim"),
        ("base", "mecanum"),
        ("feature", "page"),
        ("feature", "joints"),
        ("node", "wmx_io_node"),
        ("node", "robotd"),
        ("robot", "cr3a"),
        ("robot", "My"),
    ],
)
def test_a_name_that_is_taken_or_none_is_rejected(
    kind: str, name: str, robotd: Robotd, tmp_path: Path
) -> None:
    result = robotd("new-plugin", kind, name, "--into", str(tmp_path))
    assert result.exit_code == ExitCode.CONFIGURATION
    assert f"{kind} name {name!r}" in result.output
    assert not list(tmp_path.iterdir())
