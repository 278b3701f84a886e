"""``robotd wmx doctor``: the readiness of this machine for the WMX backend.

Most checks need neither the SDK nor the backend, and are most useful without them. The backend,
where it is installed, adds its own: entry points of the group ``robotd.wmx_doctor``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from importlib.metadata import entry_points
from pathlib import Path

from robotd.api import RobotdError, load_robot_descriptor
from robotd_wmx_commands import INSTALL, machine_checks
from robotd_wmx_commands.machine_checks import Finding
from robotd_wmx_parameters import parameter_warnings, read_wmx_parameters

CHECKS = "robotd.wmx_doctor"

BackendChecks = Callable[[Path | None, bool], Iterable[tuple[str, str, str]]]


def diagnose(root: Path | None, robots: Iterable[str], *, engine: bool) -> Iterator[Finding]:
    """Yield all findings; a check that fails unexpectedly is a finding too.

    Args:
        root: of the SDK; None: the one that a build of the backend would use.
        robots: whose parameter files are looked at.
        engine: let the backend start the engine.
    """
    sdk = root or machine_checks.default_sdk_root()
    for check in (
        machine_checks.check_machine,
        machine_checks.check_sdk,
        machine_checks.check_permissions,
        machine_checks.check_cores,
        machine_checks.check_network_cards,
        machine_checks.check_eni,
    ):
        yield from _guarded(check.__name__, partial(check, sdk))
    for robot in robots:
        yield from _guarded(f"robot {robot}", partial(_check_parameters, robot))
    yield from _guarded("backend", partial(_check_backend, root, engine))


def _guarded(name: str, check: Callable[[], Iterable[Finding]]) -> Iterator[Finding]:
    try:
        yield from check()
    except (RobotdError, OSError, ValueError) as error:
        yield Finding("failed", f"{name}: {error}")


def _check_parameters(robot: str) -> Iterator[Finding]:
    """Values of the robot's parameter file that the engine accepts and that are still unwise."""
    descriptor = load_robot_descriptor(robot)
    if descriptor.parameters_file is None:
        advice = "the engine's defaults apply: one user unit is one count; give parameters_file"
        yield Finding("failed", f"{robot}: no WMX parameter file", advice)
        return
    parameters = read_wmx_parameters(descriptor.parameters_file, descriptor.axes)
    name = f"{robot}: {descriptor.parameters_file.name}"
    yield Finding("ok", f"{name} read, {descriptor.axes} axes")
    for warning in parameter_warnings(parameters, descriptor):
        what, _, advice = warning.partition("; ")
        yield Finding("warning", what, advice)


def _check_backend(root: Path | None, engine: bool) -> Iterator[Finding]:
    """The checks of robotd-wmx, or what is missing to run them."""
    entries = list(entry_points(group=CHECKS))
    if not entries:
        yield Finding("failed", "the backend robotd-wmx is not installed", INSTALL)
        return
    for entry in entries:
        try:
            checks: BackendChecks = entry.load()
            yield from (Finding(*found) for found in checks(root, engine))
        except ImportError as error:
            advice = (
                "a library of the SDK is missing or has moved since the backend was built:"
                " reinstall the SDK, then pip install --force-reinstall --no-deps ./plugins/wmx"
            )
            yield Finding("failed", f"the backend does not load: {error}", advice)
