"""``robotd check``: check a robot's files and plugins without hardware and ROS."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

import click

from robotd.cli.check_report import CheckReport
from robotd.cli.exit_codes import ExitCode
from robotd.cli.installed import check_backend_overrides, load_installed
from robotd.cli.options import log_options, robot_options
from robotd.cli.urdf_check import check_urdf, urdf_warnings
from robotd.clock import MonotonicClock
from robotd.control.groups.descriptor_limits import fit_device
from robotd.control.groups.joint_group import ON_DEVICE
from robotd.descriptor import Override, RobotDescriptor, load_robot_descriptor
from robotd.device.capabilities import Capability
from robotd.entry_points import PluginOrigin, installed_names, load_entry, plugin_errors
from robotd.errors import PluginError, Unsupported
from robotd.feature import feature_failures
from robotd.guards import requested_guards
from robotd.plugin.hookspecs import DeviceContext
from robotd.plugin.manager import Backend, load_backend
from robotd.robot import Robot

CHECKS = "robotd.checks"
"""Entry-point group of further checks: functions that take the descriptor.

Each yields a name and a function without arguments, which returns warnings or raises RobotdError.
"""


@click.command("check")
@robot_options
@log_options
def check(**options: Any) -> ExitCode:
    """Check a robot's files and plugins, without hardware and without ROS."""
    return check_robot(**options)


def check_robot(
    robot: str, variant: str | None, overrides: Sequence[Override], backend: str | None
) -> ExitCode:
    """Check everything, print it line by line, and return the exit status."""
    report = CheckReport()
    installed = load_installed()
    for reason in (*installed.problems(), *feature_failures().values()):
        report.warn(reason)  # as 'run': the robot may do without it
    descriptor = report.run(
        f"robot {robot}",
        lambda: load_robot_descriptor(robot, variant, installed.search_path, overrides),
    )
    if descriptor is not None:
        _check_files(report, descriptor)
        nodes = ", ".join(descriptor.nodes) or "none"
        report.run(f"nodes {nodes}", lambda: installed.nodes.select(descriptor.nodes))
        report.run("ROS parameters", lambda: installed.nodes.check_parameters(descriptor))
    name = backend or (descriptor and descriptor.backend)
    plugin = report.run(f"backend {name}", lambda: load_backend(name)) if name else None
    if descriptor is not None and plugin is not None:
        _check_backend(report, descriptor, plugin, overrides)
    return report.end()


def _check_files(report: CheckReport, descriptor: RobotDescriptor) -> None:
    urdf = descriptor.urdf
    names = installed_names(CHECKS)
    for reason in names.refused.values():
        report.warn(reason)
    for origin, entry in names.entries.values():
        try:
            further = load_entry(origin, entry)
            with plugin_errors(f"check {origin}", origin.module):
                checks = [*further(descriptor)]
        except PluginError as error:
            report.warn(str(error))
            continue
        for what, check_one in checks:
            for warning in report.run(what, partial(_checked, origin, check_one)) or ():
                report.warn(warning)
    if urdf is not None:
        model = report.run(f"urdf {urdf.name}", lambda: check_urdf(urdf, descriptor))
        for warning in urdf_warnings(model, urdf, descriptor) if model else ():
            report.warn(warning)


def _checked(origin: PluginOrigin, check_one: Callable[[], Iterable[str] | None]) -> list[str]:
    """Return the warnings of one further check. Raises RobotdError: it fails."""
    with plugin_errors(f"check {origin}", origin.module):
        return [*(check_one() or ())]


def _check_backend(
    report: CheckReport,
    descriptor: RobotDescriptor,
    backend: Backend,
    overrides: Sequence[Override],
) -> None:
    name, capabilities = backend.name, backend.capabilities

    def options() -> DeviceContext[Any]:
        check_backend_overrides(overrides, name)
        return backend.context(descriptor)

    def features() -> str | None:
        needs = {"gripper": "outputs", "outputs": "outputs", "stop_input": "inputs"}
        for key, kind in (needs | {"inputs": "inputs"}).items():
            if getattr(descriptor, key) and Capability.IO not in capabilities:
                text = f"needs digital {kind}, which the {name} backend does not have"
                raise descriptor.problem(key, text)
        _check_groups(descriptor, backend)
        if descriptor.parameters_file and Capability.PARAMETERS_FILE not in capabilities:
            return "parameters_file is not used by this backend"
        return None

    context = report.run(f"options of {name}", options)
    report.run(f"features of {name}", features)
    if context is not None:
        _check_driver(report, descriptor, backend, context)
        if guards := requested_guards(descriptor):
            report.run(
                f"guards {', '.join(guards)}", lambda: Robot(descriptor, backend, MonotonicClock())
            )


def _check_driver(
    report: CheckReport, descriptor: RobotDescriptor, backend: Backend, context: DeviceContext[Any]
) -> None:
    """Compare the limits with those of the driver, and warn of what its drives do not do."""

    def notes() -> list[str]:
        driver = backend.drivers(context).axes
        limits = [f"{issue}, which applies" for issue in fit_device(descriptor, driver, name)[1]]
        return [*limits, *driver.cautions]

    name = backend.name
    for note in report.run(f"limits of {name}", notes) or ():
        report.warn(note)


def _check_groups(descriptor: RobotDescriptor, backend: Backend) -> None:
    """Raise DescriptorError for several groups on a device that interpolates trajectories.

    Whether it does may depend on its options: the drivers are made for it, and nothing is opened.
    """
    able = Capability.TRAJECTORIES_ON_DEVICE in backend.capabilities
    if not able or len(descriptor.groups) < 2:
        return
    if backend.drivers(backend.context(descriptor)).axes.follows_trajectories:
        raise descriptor.problem("groups", str(Unsupported(ON_DEVICE, backend.name)))
