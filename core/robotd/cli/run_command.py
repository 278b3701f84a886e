"""``robotd run``: serve a robot with its backend and nodes until Ctrl-C."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robotd.cli.exit_codes import ExitCode, RosUnavailable, exit_code
from robotd.cli.group import ros_args
from robotd.cli.installed import Installed, check_backend_overrides, load_installed
from robotd.cli.options import (
    FILE,
    FOLDER,
    PORT,
    log_options,
    names,
    robot_options,
)
from robotd.cli.preflight import import_ros, process_age_s
from robotd.cli.start_summary import SIMULATED, start_summary
from robotd.cli.time_scale import time_scale
from robotd.cli.timing_report import reserve_report, write_report
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
from robotd.number_argument import NumberRange
from robotd.plugin.manager import Backend, PluginOrigin, load_backend
from robotd.plugin.registry import NodeRegistry
from robotd.realtime import request_niceness, request_time_slice
from robotd.robot import Robot

if TYPE_CHECKING:
    from robotd_recorder.recorder import Recorder
    from robotd_ros.endpoints import ServeReport
    from robotd_scenario import FaultSchedule


TIME_SLICE_S = 1e-4  # the shortest: goals and services are answered sooner
RATE_HZ = NumberRange(10, 2000)  # the limits of cycle.rate_hz in a descriptor


@dataclass(frozen=True)
class RunOptions:
    """The options of the command.

    Attributes:
        robot: a name of the search path, or a file.
        variant, backend, nodes, rate_hz: None leaves the descriptor's own.
        overrides: values that replace those of the robot's file.
        report: file for the loop timing, written after an orderly stop; None: not written.
        time_scale: simulated seconds per second, infinity: as fast as possible; None: real time.
        scenario: file whose options and faults are used; None: no scheduled faults.
        record_dir: folder of the flight recorder; None leaves the descriptor's own.
        record: folder of a continuous recording; None: none.
        metrics: port of the metrics on the loopback interface; None: not served.
        page: port of the live page there; None leaves the descriptor's own.
        page_control: the page can control the robot; None leaves the descriptor's own.
        foxglove: port for the program Foxglove there; None: not served.
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
    record_dir: Path | None
    record: Path | None
    metrics: int | None
    page: int | None
    page_control: bool | None
    foxglove: int | None
    ros_args: Sequence[str]


@click.command("run", epilog="What follows --ros-args goes to ROS: remaps, -p, --params-file.")
@robot_options
@click.option("--nodes", metavar="A,B", callback=names, help="Only these of the robot's nodes.")
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
@time_scale
@click.option(
    "--scenario",
    metavar="FILE",
    type=FILE,
    help="Simulation: inject the faults defined in FILE.",
)
@click.option(
    "--record",
    metavar="DIR",
    type=FOLDER,
    help="Record everything there, as MCAP files.",
)
@click.option(
    "--record-dir",
    metavar="DIR",
    type=FOLDER,
    help="Folder of the flight recorder; short for --set recorder.folder=DIR.",
)
@click.option(
    "--metrics",
    metavar="PORT",
    type=PORT,
    help="Serve metrics for Prometheus at http://127.0.0.1:PORT/metrics.",
)
@click.option(
    "--page",
    metavar="PORT",
    type=PORT,
    help="Serve the live page at http://127.0.0.1:PORT; 0: any free port, which the log names.",
)
@click.option(
    "--page-control/--no-page-control",
    default=None,
    help="Let the page jog and command the robot, with a token that is printed at the start.",
)
@click.option(
    "--foxglove",
    metavar="PORT",
    type=PORT,
    help="Serve the program Foxglove at ws://127.0.0.1:PORT.",
)
@log_options
def run(**options: Any) -> ExitCode:
    """Serve the robot until Ctrl-C."""
    return run_robot(RunOptions(**options, ros_args=ros_args()))


def run_robot(options: RunOptions) -> ExitCode:
    """Serve the robot and return the exit status. Raises RobotdError before opening it."""
    installed = load_installed()
    installed.warn()
    descriptor = _descriptor(options, installed)
    nodes = _chosen_nodes(descriptor, options.nodes)
    backend = load_backend(options.backend or descriptor.backend)
    check_backend_overrides(options.overrides, backend.name)
    robot, faults = _made(descriptor, backend, options)
    prioritize(robot)
    if options.report:
        reserve_report(options.report)
    with _observed(robot, nodes, options, faults) as observation:
        return _serve(robot, backend.origin, nodes, installed.nodes, options, faults, observation)


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


@dataclass(frozen=True)
class _Observation:
    """Parts that observe the robot.

    Attributes:
        recorder: None where nothing is recorded, counted or shown.
        page: address of the page, with the token of its control; "" without one.
    """

    recorder: Recorder | None = None
    page: str = ""


@contextmanager
def _observed(
    robot: Robot, nodes: Sequence[str], options: RunOptions, faults: FaultSchedule | None
) -> Iterator[_Observation]:
    """Observe the robot and serve its page, as far as that is wanted."""
    page = robot.descriptor.page if options.page is None else options.page
    if options.page_control and page is None:
        raise click.UsageError("--page-control needs --page PORT, or page: in the robot's file")
    ports = (options.metrics, options.foxglove, page)
    wanted = any(each is not None for each in (options.record, *ports))
    if not (robot.descriptor.recorder.enabled or wanted):
        yield _Observation()
        return
    from robotd.local_ports import reserve_files
    from robotd_recorder.recorder import observed

    reserve_files()
    with ExitStack() as stack:
        recorder = stack.enter_context(
            observed(
                robot,
                flight_folder=options.record_dir,
                record_folder=options.record,
                metrics_port=options.metrics,
                count_metrics=page is not None,
            )
        )
        address = ""
        if page is not None:
            has_control = robot.descriptor.page_control
            if options.page_control is not None:
                has_control = options.page_control
            namespace = namespace_of(options.ros_args)
            served = _page(recorder, nodes, page, has_control, faults, namespace)
            address = stack.enter_context(served)
        if options.foxglove is not None:
            stack.enter_context(_foxglove(recorder, options.foxglove))
        yield _Observation(recorder, address)


@contextmanager
def _page(
    recorder: Recorder,
    nodes: Sequence[str],
    port: int,
    has_control: bool,
    faults: FaultSchedule | None,
    namespace: str,
) -> Iterator[str]:
    """Serve the page; the value is its address."""
    try:
        from robotd_page.control_server import PageControl
        from robotd_page.page_server import PageServer
        from robotd_page.robot_source import RobotSource
    except ImportError as error:
        raise OperationError("the page needs aiohttp: pip install 'robotd[page]'") from error
    control = PageControl(recorder.tap.robot, faults) if has_control else None
    source = RobotSource(recorder.tap, nodes, has_control=has_control, namespace=namespace)
    with PageServer(source, port, recorder.metrics, control=control) as server:
        yield control.address(server.url) if control else server.url


def namespace_of(ros_args: Sequence[str]) -> str:
    """Return the namespace that ROS arguments give to all nodes: of the last ``__ns:=``."""
    found = [word.partition("__ns:=")[2] for word in ros_args if word.startswith("__ns:=")]
    return f"/{found[-1].strip('/')}" if found else "/"


def _foxglove(recorder: Recorder, port: int) -> AbstractContextManager[object]:
    try:
        from robotd_foxglove.foxglove_server import FoxgloveServer
    except ImportError as error:
        text = "--foxglove needs foxglove-sdk: pip install 'robotd[foxglove]'"
        raise OperationError(text) from error
    return FoxgloveServer(recorder.tap, port)


def _serve(
    robot: Robot,
    origin: PluginOrigin,
    nodes: Sequence[str],
    registry: NodeRegistry,
    options: RunOptions,
    faults: FaultSchedule | None,
    observation: _Observation,
) -> ExitCode:
    server = import_ros("robotd_ros.serve")
    is_served = False

    def served(report: ServeReport) -> None:
        nonlocal is_served
        is_served = True
        _say(start_summary(robot, origin, report))

    def ready() -> None:
        if faults is not None:
            faults.begin()
        if observation.page:
            _say(_page_text(observation.page))
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
            recorder=observation.recorder,
        )
    except OperationError as error:
        # The device is touched after the nodes exist; an earlier error comes from ROS.
        if is_served or isinstance(error, InvalidArgument):
            raise
        raise RosUnavailable(str(error)) from error
    return ExitCode(code)


def _page_text(address: str) -> str:
    """Return the line about the page, with the token, which no log may have."""
    controls = " moves the robot: keep it to yourself" if "#" in address else ""
    return f"page {address}{controls}"


def _say(text: str) -> None:
    """Print to standard output; a broken pipe must not stop the robot."""
    click.echo(text, file=lossy(sys.stdout))


def _made(
    descriptor: RobotDescriptor, backend: Backend, options: RunOptions
) -> tuple[Robot, FaultSchedule | None]:
    """Return the robot on its clock, and its fault schedule on a simulated one."""
    scale = options.time_scale
    clock = MonotonicClock() if scale is None else PacedClock(scale)
    if scale is None and options.scenario is None:
        return Robot(descriptor, backend, clock), None
    if SIMULATED not in backend.capabilities:
        text = f"the backend {backend.name} is not simulated"
        raise click.BadParameter(text, param_hint="'--time-scale', '--scenario'")
    from robotd_scenario import FaultSchedule, load_scenario

    if options.scenario is None:
        robot = Robot(descriptor, backend, clock)
        return robot, FaultSchedule(robot)
    scenario = load_scenario(options.scenario)
    robot = Robot(scenario.lay_over(descriptor), backend, clock)
    return robot, FaultSchedule(robot, scenario.faults)


def _descriptor(options: RunOptions, installed: Installed) -> RobotDescriptor:
    overrides = [*options.overrides]
    if options.rate_hz is not None:
        overrides.append(parse_override(f"cycle.rate_hz={options.rate_hz}"))
    descriptor = load_robot_descriptor(
        options.robot, options.variant, installed.search_path, overrides
    )
    installed.check_nodes(descriptor)
    return descriptor


def _chosen_nodes(descriptor: RobotDescriptor, wanted: Sequence[str] | None) -> tuple[str, ...]:
    for name in wanted or ():
        if name not in descriptor.nodes:
            text = unknown_name(f"node of {descriptor.name}", name, descriptor.nodes)
            raise click.BadParameter(text, param_hint="'--nodes'")
    return descriptor.nodes if wanted is None else tuple(wanted)
