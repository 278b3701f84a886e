"""Doctor of WMX: the readiness of this machine, with or without SDK and backend.

The backend robotd-wmx, where it is installed, adds its findings under the same name.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

from robotd.api import Finding, MachineContext, RobotDescriptor
from robotd_wmx_commands import INSTALL, machine_checks
from robotd_wmx_parameters import parameter_warnings, read_wmx_parameters

BACKEND = "robotd_wmx"


def checks(context: MachineContext) -> Iterator[Finding]:
    """Yield the findings that need no backend; option ``sdk``: root of the SDK."""
    named = context.options.get("sdk")
    sdk = Path(named) if named else machine_checks.default_sdk_root()
    for check in (
        machine_checks.check_machine,
        machine_checks.check_sdk,
        machine_checks.check_permissions,
        machine_checks.check_cores,
        machine_checks.check_network_cards,
        machine_checks.check_eni,
    ):
        try:
            yield from check(sdk)
        except (OSError, ValueError) as error:
            yield Finding("failed", f"{check.__name__}: {error}")
    for robot in context.robots:
        yield from _check_parameters(robot)
    if find_spec(BACKEND) is None:
        yield Finding("failed", "the backend robotd-wmx is not installed", INSTALL)


def _check_parameters(robot: RobotDescriptor) -> Iterator[Finding]:
    """Values of the robot's parameter file that the engine accepts and that are still unwise."""
    if robot.parameters_file is None:
        advice = "the engine's defaults apply: one user unit is one count; give parameters_file"
        yield Finding("failed", f"{robot.name}: no WMX parameter file", advice)
        return
    parameters = read_wmx_parameters(robot.parameters_file, robot.axes)
    name = f"{robot.name}: {robot.parameters_file.name}"
    yield Finding("ok", f"{name} read, {robot.axes} axes")
    for warning in parameter_warnings(parameters, robot):
        what, _, advice = warning.partition("; ")
        yield Finding("warning", what, advice)
