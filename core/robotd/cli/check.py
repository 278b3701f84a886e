"""``robotd check``: everything that can be known wrong without hardware and without ROS."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import click

from robotd.cli.catalogue import load_catalogue
from robotd.cli.exit_codes import ExitCode, exit_code
from robotd.cli.urdf import check_urdf
from robotd.descriptor import RobotDescriptor, load_robot_descriptor, read_wmx_parameters
from robotd.device.capabilities import Capability
from robotd.errors import DescriptorError, PluginError, RobotdError
from robotd.plugin.manager import Backend, load_backend

Found = TypeVar("Found")


@dataclass
class _Report:
    """Prints a line for each check; ``code`` is the exit status of the first that failed."""

    code: ExitCode = ExitCode.OK
    problems: int = 0

    def run(self, what: str, check: Callable[[], Found]) -> Found | None:
        """The result of ``check``; None when it raised. A text is printed beside ``what``."""
        try:
            found = check()
        except RobotdError as error:
            self.fail(what, error)
            return None
        self._line("ok", "green", f"{what}: {found}" if isinstance(found, str) else what)
        return found

    def fail(self, what: str, error: RobotdError) -> None:
        self.code = self.code or exit_code(error)
        lines = str(error).splitlines()
        self.problems += len(lines)
        self._line("fail", "red", what)
        for line in lines:
            click.echo(f"      {line}")

    def _line(self, word: str, colour: str, text: str) -> None:
        click.echo(f"{click.style(word.ljust(4), fg=colour)}  {text}")


def check_robot(robot: str, variant: str | None, backend: str | None) -> int:
    """Check everything, print it line by line, and return the exit status."""
    report = _Report()
    catalogue = load_catalogue()
    for origin, reason in catalogue.failures.items():
        report.fail(f"plugin {origin.name}", PluginError(reason))
    descriptor = report.run(
        f"robot {robot}", lambda: load_robot_descriptor(robot, variant, catalogue.search_path)
    )
    if descriptor is not None:
        _check_files(report, descriptor)
        nodes = ", ".join(descriptor.nodes) or "none"
        report.run(f"nodes {nodes}", lambda: catalogue.check_nodes(descriptor))
    name = backend or (descriptor and descriptor.backend)
    plugin = report.run(f"backend {name}", lambda: load_backend(name)) if name else None
    if descriptor is not None and plugin is not None:
        _check_backend(report, descriptor, plugin)
    problems = f"{report.problems} problem{'' if report.problems == 1 else 's'}"
    click.echo(problems if report.problems else "all is well")
    return report.code


def _check_files(report: _Report, descriptor: RobotDescriptor) -> None:
    parameters, urdf = descriptor.parameters_file, descriptor.urdf
    if parameters is not None:
        report.run(
            f"parameters {parameters.name}",
            lambda: read_wmx_parameters(parameters).missing_summary() or None,
        )
    if urdf is not None:
        report.run(f"urdf {urdf.name}", lambda: check_urdf(urdf, descriptor))


def _check_backend(report: _Report, descriptor: RobotDescriptor, backend: Backend) -> None:
    name, capabilities = backend.info.name, backend.info.capabilities

    def features() -> str | None:
        if descriptor.gripper and Capability.IO not in capabilities:
            raise DescriptorError(
                f"needs digital outputs, which the {name} backend does not have",
                path=descriptor.path,
                key="gripper",
            )
        if descriptor.parameters_file and Capability.PARAMETERS_FILE not in capabilities:
            return "parameters_file is not used by this backend"
        return None

    report.run(f"options of {name}", lambda: backend.options(descriptor))
    report.run(f"features of {name}", features)
