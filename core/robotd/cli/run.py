"""``robotd run``: put robot, backend and nodes together and serve them until Ctrl-C."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from robotd.cli.catalogue import Catalogue, check_backend_overrides, load_catalogue
from robotd.cli.exit_codes import ExitCode, RosUnavailable, exit_code
from robotd.cli.preflight import import_ros, process_age_s
from robotd.cli.report import reserve_report, write_report
from robotd.cli.summary import SIMULATED, start_summary
from robotd.clock import MonotonicClock
from robotd.clock.simulated import PacedClock
from robotd.descriptor import (
    Override,
    RobotDescriptor,
    load_robot_descriptor,
    parse_override,
)
from robotd.errors import InvalidArgument, OperationError, unknown_name
from robotd.log import lossy
from robotd.plugin.manager import Backend, PluginOrigin, load_backend
from robotd.plugin.registry import NodeRegistry
from robotd.robot import Robot

if TYPE_CHECKING:
    from robotd.ros.endpoints import ServeReport
    from robotd.scenario import FaultSchedule


@dataclass(frozen=True)
class RunOptions:
    """The options of the command.

    Attributes:
        robot: a name of the search path, or a file.
        variant, backend, nodes, rate_hz: None leaves the descriptor's own.
        overrides: values that replace those of the robot's file.
        report: where the cycle's timing is written after an orderly stop; None: nowhere.
        time_scale: simulated seconds per second, infinity for as fast as it goes; None: real time.
        scenario: whose options and faults are used; None: no faults but those asked for later.
        ros_args: from ``--ros-args`` on, for rclpy.
    """

    robot: str
    variant: str | None
    backend: str | None
    nodes: Sequence[str] | None
    overrides: Sequence[Override]
    rate_hz: float | None
    report: Path | None
    time_scale: float | None
    scenario: Path | None
    ros_args: Sequence[str]


def run_robot(options: RunOptions) -> int:
    """Serve the robot; returns the exit status. Raises RobotdError before anything is opened."""
    catalogue = load_catalogue()
    catalogue.warn()
    descriptor = _descriptor(options, catalogue)
    nodes = _chosen_nodes(descriptor, options.nodes)
    backend = load_backend(options.backend or descriptor.backend)
    check_backend_overrides(options.overrides, backend.name)
    robot, faults = _made(descriptor, backend, options)
    if options.report:
        reserve_report(options.report)
    return _serve(robot, backend.origin, nodes, catalogue.nodes, options, faults)


def _serve(
    robot: Robot,
    origin: PluginOrigin,
    nodes: Sequence[str],
    registry: NodeRegistry,
    options: RunOptions,
    faults: FaultSchedule | None,
) -> int:
    server = import_ros("serve")
    is_served = False

    def served(report: ServeReport) -> None:
        nonlocal is_served
        is_served = True
        _say(start_summary(robot, origin, report))

    def ready() -> None:
        if faults is not None:
            faults.begin()
        _say(f"ready after {process_age_s():.1f} s, stop with Ctrl-C")

    def ended(error: Exception | None) -> ExitCode:
        if error is not None:
            return exit_code(error)
        if options.report:
            write_report(options.report, robot.control_loop)
        return ExitCode.OK

    try:
        code = server.serve(
            robot,
            nodes,
            options.ros_args,
            registry=registry,
            served=served,
            ready=ready,
            ended=ended,
            faults=faults,
        )
    except OperationError as error:
        # The device is touched only after the nodes are there: until then it can be but ROS.
        if is_served or isinstance(error, InvalidArgument):
            raise
        raise RosUnavailable(str(error)) from error
    return int(code)


def _say(text: str) -> None:
    """To standard output; that it is full or that nobody reads it must not stop the robot."""
    click.echo(text, file=lossy(sys.stdout))


def _made(
    descriptor: RobotDescriptor, backend: Backend, options: RunOptions
) -> tuple[Robot, FaultSchedule | None]:
    """The robot on its clock, and what may go wrong with it; None where that is nothing."""
    scale = options.time_scale
    clock = MonotonicClock() if scale is None else PacedClock(scale)
    if scale is None and options.scenario is None:
        return Robot(descriptor, backend, clock), None
    if SIMULATED not in backend.capabilities:
        text = f"the backend {backend.name} is not simulated"
        raise click.BadParameter(text, param_hint="'--time-scale', '--scenario'")
    from robotd.scenario import FaultSchedule, load_scenario

    if options.scenario is None:
        robot = Robot(descriptor, backend, clock)
        return robot, FaultSchedule(robot)
    scenario = load_scenario(options.scenario)
    robot = Robot(scenario.lay_over(descriptor), backend, clock)
    return robot, FaultSchedule(robot, scenario.faults)


def _descriptor(options: RunOptions, catalogue: Catalogue) -> RobotDescriptor:
    overrides = [*options.overrides]
    if options.rate_hz is not None:
        overrides.append(parse_override(f"cycle.rate_hz={options.rate_hz}"))
    descriptor = load_robot_descriptor(
        options.robot, options.variant, catalogue.search_path, overrides
    )
    catalogue.check_nodes(descriptor)
    return descriptor


def _chosen_nodes(descriptor: RobotDescriptor, wanted: Sequence[str] | None) -> tuple[str, ...]:
    for name in wanted or ():
        if name not in descriptor.nodes:
            text = unknown_name(f"node of {descriptor.name}", name, descriptor.nodes)
            raise click.BadParameter(text, param_hint="'--nodes'")
    return descriptor.nodes if wanted is None else tuple(wanted)
