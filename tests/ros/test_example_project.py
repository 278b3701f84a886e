"""Sample project: its tests pass unchanged, and both CI recipes run them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

pytestmark = pytest.mark.ros

ROOT = Path(__file__).parents[2]
PROJECT = ROOT / "examples" / "pick_and_place"


def github() -> list[str]:
    workflow: Any = yaml.safe_load((PROJECT / ".github/workflows/test.yml").read_text("utf-8"))
    scripts = [step["run"] for step in workflow["jobs"]["test"]["steps"] if "run" in step]
    return [line for script in scripts for line in script.strip().splitlines()]


def gitlab() -> list[str]:
    recipe: Any = yaml.safe_load((PROJECT / ".gitlab-ci.yml").read_text("utf-8"))
    script: list[str] = recipe["test"]["script"]
    return script


def test_both_recipes_do_the_same() -> None:
    assert github() == gitlab()


def test_the_recipes_install_what_there_is() -> None:
    install = next(line for line in gitlab() if "pip install" in line)
    names = tomllib.loads((ROOT / "interfaces/pyproject.toml").read_text("utf-8"))["project"]
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    assert f'"{names["name"]} @ $ROBOTD#subdirectory=interfaces"' in install
    assert '"robotd[ros,testing,mujoco] @ $ROBOTD"' in install
    assert {"ros", "testing", "mujoco"} <= set(extras["optional-dependencies"])


def test_what_the_recipes_run_passes(tmp_path: Path) -> None:
    copy = tmp_path / "project"
    shutil.copytree(PROJECT, copy, ignore=shutil.ignore_patterns("__pycache__"))
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    for command in gitlab()[2:]:
        words = command.replace(".venv/bin/", "").split()
        result = subprocess.run(
            words, cwd=copy, env=os.environ | {"PATH": path}, capture_output=True, text=True,
            check=False, timeout=120,
        )  # fmt: skip
        assert result.returncode == 0, result.stdout + result.stderr
    assert (copy / "report.xml").exists()
