"""``robotd conform``: the conformance checks as a command, with pytest underneath."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import robotd
from robotd.cli.catalogue import load_catalogue
from robotd.cli.exit_codes import ExitCode
from robotd.descriptor import load_robot_descriptor
from robotd.errors import PluginError
from robotd.plugin.manager import load_backend

PACKAGE = "robotd.testing.conformance"


def run_conformance(
    backend: str,
    robot: str | None,
    junit: Path | None,
    expression: str | None,
    pytest_arguments: Sequence[str],
) -> int:
    """Run the checks in a process of their own; returns the exit status.

    Raises PluginError or DescriptorError when backend or robot cannot be loaded.
    """
    if find_spec("pytest") is None:
        raise PluginError("the checks need pytest: pip install 'robotd[testing]'")
    load_backend(backend)
    if robot is not None:
        load_robot_descriptor(robot, search_path=load_catalogue().search_path)
    arguments = [
        f"--robotd-backend={backend}",
        *([f"--robotd-robot={robot}"] if robot else []),
        *([f"--junitxml={junit}"] if junit else []),
        *(["-k", expression] if expression else []),
        *pytest_arguments,
    ]
    done = subprocess.run([*pytest_command(), *arguments], check=False, env=_environment())  # noqa: S603 - our own command line
    return ExitCode.OK if done.returncode == 0 else ExitCode.PLUGIN


def pytest_command() -> list[str]:
    """The command line of pytest on the checks; settings in the present folder do not count."""
    checks = Path(robotd.__file__).parent.joinpath(*PACKAGE.split(".")[1:])
    return [
        sys.executable,
        "-m",
        "pytest",
        "--pyargs",
        PACKAGE,
        f"--rootdir={checks}",
        f"--config-file={os.devnull}",
        "--import-mode=importlib",
        "--quiet",
        "-rN",  # the report at the end names what failed
        "--tb=short",
        "-p",
        "no:cacheprovider",
    ]


def _environment() -> dict[str, str]:
    """Without what could keep pytest from finding robotd's options."""
    return {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
