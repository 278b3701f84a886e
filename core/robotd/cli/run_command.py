"""``robotd run``: serve a robot with its backend and nodes until Ctrl-C."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import click

from robotd.cli.exit_codes import ExitCode, RosUnavailable, exit_code
from robotd.cli.group import ros_args
from robotd.cli.installed import Installed, check_backend_overrides, load_installed
from robotd.cli.layout import warn
from robotd.cli.options import (
    FILE,
    log_options,
    namespace_option,
    parse_names,
    robot_options,
)
from robotd.cli.preflight import import_ros, process_age_s
from robotd.cli.shell_values import installed_robots
from robotd.cli.start_summary import SIMULATED, ServeReport, start_summary
from robotd.cli.time_scale import time_scale
from robotd.cli.timing_report import reserve_report, write_report
from robotd.clock import Clock, MonotonicClock
from robotd.clock.simulated import PacedClock
from robotd.descriptor import (
    Override,
    RobotDescriptor,
    load_robot_descriptor,
    override,
    parse_override,
)
from robotd.errors import InvalidArgument, OperationError, unknown_name
from robotd.feature import feature_failures, installed_features
from robotd.feature_host import FeatureHost, call_each, open_features, prepared
from robotd.log import lossy
from robotd.number_argument import NumberRange
from robotd.plugin.manager import Backend, PluginOrigin, load_backend
from robotd.plugin.registry import NodeRegistry
from robotd.realtime import request_niceness, request_time_slice
from robotd.robot import Robot
from robotd.stop_signals import ended_by_interrupt

FEATURE_OVERRIDES = "robotd.feature_overrides"
TIME_SLICE_S = 1e-4  # the shortest: goals and services are answered sooner
RATE_HZ = NumberRange(10, 2000)  # the limits of cycle.rate_hz in a descriptor


class RunCommand(click.Command):
    """``robotd run`` with the options of the installed features."""

    @ended_by_interrupt()
    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the options; features that cannot be used are reported first."""
        for reason in feature_failures().values():
            warn(reason)
        if args and not args[0].startswith("-") and args[0] in installed_robots():
            raise click.UsageError(f"a robot is an option: --robot {args[0]}", ctx)
        return super().parse_args(ctx, args)

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """Return the own options, then those of the features, then ``--help``."""
        *own, last = super().get_params(ctx)
        options = [
            option for feature in installed_features().values() for option in feature.options
        ]
        added = [option.parameter(partial(_keep_override, option.key)) for option in options]
        return [*own, *added, last]


def _keep_override(key: str, ctx: click.Context, option: click.Parameter, value: Any) -> None:
    if value is not None:
        found = ctx.meta.setdefault(FEATURE_OVERRIDES, {})
        found[key] = override(key, value)


def feature_overrides() -> list[Override]:
    """Return the options of features that were given, as overrides. In a command."""
    return [*click.get_current_context().meta.get(FEATURE_OVERRIDES, {}).values()]


@dataclass(frozen=True)
class RunOptions:
    """The options of the command.

    Attributes:
        robot: a name of the search path, or a file.
        variant, backend, nodes, rate_hz: None leaves the descriptor's own.
        overrides: values that replace those of the robot's file.
        report: file for the loop timing, written after an orderly stop; None: not written.
        verbose: print the long summary.
        time_scale: simulated seconds per second, infinity: as fast as possible; None: real time.
        ros_args: from ``--ros-args`` on, for rclpy.
    """

    robot: str
    variant: str | None
    backend: str | None
    nodes: Sequence[str] | None
    overrides: Sequence[Override]
    rate_hz: float | None
    report: Path | None
    verbose: bool
    time_scale: float | None
    ros_args: Sequence[str]


@click.command(
    "run", cls=RunCommand, epilog="What follows --ros-args goes to ROS: remaps, -p, --params-file."
)
@robot_options
@click.option(
    "--nodes", metavar="A,B", callback=parse_names, help="Only these of the robot's nodes."
)
@click.option(
    "--rate",
    "rate_hz",
    metavar="HZ",
    type=RATE_HZ,
    help="Short for --set cycle.rate_hz=HZ.",
)
@click.option(
    "--report",
    metavar="FILE",
    type=FILE,
    help="Write the timing of the last periods there, as JSON, when stopped.",
)
@click.option(
    "--verbose", is_flag=True, help="Print joints, nodes, topics and actions at the start."
)
@namespace_option
@time_scale
@log_options
def run(**options: Any) -> ExitCode:
    """Serve the robot until Ctrl-C."""
    options["overrides"] = (*options["overrides"], *feature_overrides())
    return run_robot(RunOptions(**options, ros_args=ros_args()))


@ended_by_interrupt()
def run_robot(options: RunOptions) -> ExitCode:
    """Serve the robot and return the exit status. Raises RobotdError before opening it.

    Until it is served Ctrl-C ends the process at once: nothing is open.
    """
    installed = load_installed()
    installed.warn()
    descriptor = _descriptor(options, installed)
    nodes = _chosen_nodes(descriptor, options.nodes)
    backend = load_backend(options.backend or descriptor.backend)
    check_backend_overrides(options.overrides, backend.name)
    robot = Robot(*_prepared(descriptor, backend, options))
    prioritize(robot)
    if options.report:
        reserve_report(options.report)
    with open_features(robot, nodes, namespace_of(options.ros_args), _say) as features:
        return _serve(robot, backend.origin, nodes, installed.nodes, options, features)


def prioritize(robot: Robot) -> None:
    """Request a short time slice and ``cycle.niceness`` for all threads of this process.

    Call it before they are started. A thread that holds the interpreter while other programs have
    its core delays the control loop, whatever priority that has. Not in simulated time, which would
    take all of a core.
    """
    if not isinstance(robot.clock, MonotonicClock):
        return
    if niceness := robot.descriptor.cycle.niceness:
        request_niceness(niceness)
    request_time_slice(TIME_SLICE_S)


def namespace_of(ros_args: Sequence[str]) -> str:
    """Return the namespace that ROS arguments give to all nodes: of the last ``__ns:=``."""
    found = [word.partition("__ns:=")[2] for word in ros_args if word.startswith("__ns:=")]
    return f"/{found[-1].strip('/')}" if found else "/"


def _serve(
    robot: Robot,
    origin: PluginOrigin,
    nodes: Sequence[str],
    registry: NodeRegistry,
    options: RunOptions,
    features: FeatureHost,
) -> ExitCode:
    serve = _server(registry)
    is_served = False

    def served(report: ServeReport) -> None:
        nonlocal is_served
        is_served = True
        _say(start_summary(robot, origin, report, verbose=options.verbose))
        call_each(features.on_served)

    def ready() -> None:
        call_each(features.on_ready)
        _say(f"ready after {process_age_s():.1f} s, stop with Ctrl-C")

    def ended(error: Exception | None) -> ExitCode:
        if error is not None:
            return exit_code(error)
        if options.report:
            write_report(options.report, robot.control_loop)
        return ExitCode.OK

    try:
        code = serve(
            robot,
            nodes,
            options.ros_args,
            registry=registry,
            served=served,
            ready=ready,
            ended=ended,
            parts=features.parts,
        )
    except OperationError as error:
        # The device is touched after the nodes exist; an earlier error comes from ROS.
        if is_served or isinstance(error, InvalidArgument):
            raise
        raise RosUnavailable(str(error)) from error
    return ExitCode(code)


def _server(registry: NodeRegistry) -> Callable[..., int]:
    """Return what serves nodes. Raises RosUnavailable: no plugin does, or ROS is not there."""
    if not registry.server:
        raise RosUnavailable("no installed plugin serves ROS nodes: robotd_ros is missing")
    module, _, function = registry.server.partition(":")
    serve: Callable[..., int] = getattr(import_ros(module), function)
    return serve


def _say(text: str) -> None:
    """Print to standard output; a broken pipe must not stop the robot."""
    click.echo(text, file=lossy(sys.stdout))


def _prepared(
    descriptor: RobotDescriptor, backend: Backend, options: RunOptions
) -> tuple[RobotDescriptor, Backend, Clock]:
    """Return what the robot is made of: the features may change its descriptor."""
    scale = options.time_scale
    if scale is not None and SIMULATED not in backend.capabilities:
        text = f"the backend {backend.name} is not simulated"
        raise click.BadParameter(text, param_hint="'--time-scale'")
    descriptor = prepared(descriptor, backend)
    return descriptor, backend, MonotonicClock() if scale is None else PacedClock(scale)


def _descriptor(options: RunOptions, installed: Installed) -> RobotDescriptor:
    overrides = [*options.overrides]
    if options.rate_hz is not None:
        overrides.append(parse_override(f"cycle.rate_hz={options.rate_hz}"))
    descriptor = load_robot_descriptor(
        options.robot, options.variant, installed.search_path, overrides
    )
    installed.nodes.select(descriptor.nodes)
    return descriptor


def _chosen_nodes(descriptor: RobotDescriptor, wanted: Sequence[str] | None) -> tuple[str, ...]:
    for name in wanted or ():
        if name not in descriptor.nodes:
            text = unknown_name(f"node of {descriptor.name}", name, descriptor.nodes)
            raise click.BadParameter(text, param_hint="'--nodes'")
    return descriptor.nodes if wanted is None else tuple(wanted)
