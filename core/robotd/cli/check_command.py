"""``robotd check``: check a robot's files and plugins without hardware and ROS."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import click

from robotd.cli.check_report import CheckReport
from robotd.cli.exit_codes import ExitCode
from robotd.cli.installed import check_backend_overrides, load_installed
from robotd.cli.options import log_options, robot_options
from robotd.cli.plugin_commands import load_entry
from robotd.cli.urdf_check import check_urdf, urdf_warnings
from robotd.control.axis_limits import fit_device
from robotd.control.joint_group import ON_DEVICE
from robotd.descriptor import Override, RobotDescriptor, load_robot_descriptor
from robotd.device.capabilities import Capability
from robotd.entry_points import entry_points
from robotd.errors import DescriptorError, PluginError, Unsupported
from robotd.plugin.hookspecs import DeviceContext
from robotd.plugin.manager import Backend, load_backend

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
    for origin, reason in installed.failures.items():
        report.fail(f"plugin {origin.name}", PluginError(reason))
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
    for entry in entry_points(group=CHECKS):
        try:
            further = load_entry(entry, f"check {entry.name!r}")
        except PluginError as error:
            report.fail(f"check {entry.name}", error)
            continue
        for what, check_one in further(descriptor):
            for warning in report.run(what, check_one) or ():
                report.warn(warning)
    if urdf is not None:
        model = report.run(f"urdf {urdf.name}", lambda: check_urdf(urdf, descriptor))
        for warning in urdf_warnings(model, urdf, descriptor) if model else ():
            report.warn(warning)


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
                raise DescriptorError(
                    f"needs digital {kind}, which the {name} backend does not have",
                    path=descriptor.path,
                    key=key,
                )
        _check_groups(descriptor, backend)
        if descriptor.parameters_file and Capability.PARAMETERS_FILE not in capabilities:
            return "parameters_file is not used by this backend"
        return None

    context = report.run(f"options of {name}", options)
    report.run(f"features of {name}", features)
    if context is not None:
        fit = report.run(
            f"limits of {name}",
            lambda: fit_device(descriptor, backend.drivers(context).axes, name),
        )
        for note in fit[1] if fit else ():
            report.warn(f"{note}, which applies")


def _check_groups(descriptor: RobotDescriptor, backend: Backend) -> None:
    """Raise DescriptorError for several groups on a device that interpolates trajectories.

    Whether it does may depend on its options: the drivers are made for it, and nothing is opened.
    """
    able = Capability.TRAJECTORIES_ON_DEVICE in backend.capabilities
    if not able or len(descriptor.groups) < 2 or descriptor.tree is None:
        return
    if backend.drivers(backend.context(descriptor)).axes.follows_trajectories:
        node = descriptor.tree.find(["groups"])
        what = str(Unsupported(ON_DEVICE, backend.name))
        raise DescriptorError(what, path=node.path, line=node.line, key="groups")
