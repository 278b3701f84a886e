"""Every command with its options. What a command does is in the file of its name."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import click

from robotd.cli.group import RobotdGroup, ros_args

# Nothing but click is imported up here: `robotd --help` must not wait for numpy or ROS.

RATE_HZ = click.FloatRange(10, 2000)  # the limits of cycle.rate_hz in a descriptor
LOG_LEVELS = ("debug", "info", "warning", "error")
LOG_FORMATS = ("console", "json")

Command = Callable[..., Any]


def _names(ctx: click.Context, option: click.Parameter, value: str | None) -> list[str] | None:
    """``a,b`` → ``[a, b]``; None when the option is not given."""
    if value is None:
        return None
    names = [name.strip() for name in value.split(",") if name.strip()]
    if not names:
        raise click.BadParameter("no name given")
    return list(dict.fromkeys(names))


def _not_nan(ctx: click.Context, option: click.Parameter, value: float | None) -> float | None:
    if value is not None and math.isnan(value):  # no comparison with a limit holds it back
        raise click.BadParameter("nan is not a number")
    return value


def _keep(ctx: click.Context, option: click.Parameter, value: str) -> None:
    ctx.meta[str(option.name)] = value


def _configure_logging(ctx: click.Context) -> None:
    from robotd.log import LogFormat, configure_logging

    configure_logging(ctx.meta["log_level"], LogFormat(ctx.meta["log_format"]))


def robot_options(command: Command) -> Command:
    """Which robot: name or file, variant, backend."""
    for option in (
        click.option("--backend", metavar="NAME", help="Backend; by default the robot's own."),
        click.option("--variant", metavar="NAME", help="Variant of the robot; see 'robots'."),
        click.option("--robot", metavar="NAME|FILE", required=True, help="The robot."),
    ):
        command = option(command)
    return command


def log_options(command: Command) -> Command:
    """How much is logged to standard error, and how."""
    for name, choices, default, text in (
        ("--log-format", LOG_FORMATS, "console", "Lines for people, or JSON."),
        ("--log-level", LOG_LEVELS, "info", "'debug' shows tracebacks too."),
    ):
        command = click.option(
            name,
            type=click.Choice(choices),
            default=default,
            show_default=True,
            callback=_keep,
            expose_value=False,
            is_eager=True,
            help=text,
        )(command)
    return command


as_json = click.option("--json", "as_json", is_flag=True, help="Print JSON, for programs.")


@click.group(
    cls=RobotdGroup,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="Without a command it is 'run': robotd --robot cr3a --backend sim",
)
@click.version_option(package_name="robotd", message="robotd %(version)s")
def main() -> None:
    """Serve a robot on ROS 2, whatever drives it."""


@main.command("run", epilog="What follows --ros-args goes to ROS: remaps, -p, --params-file.")
@robot_options
@click.option("--nodes", metavar="A,B", callback=_names, help="Only these of the robot's nodes.")
@click.option(
    "--rate",
    "rate_hz",
    metavar="HZ",
    type=RATE_HZ,
    callback=_not_nan,
    help="Cycle rate, 10 to 2000; by default the robot's own.",
)
@log_options
@click.pass_context
def run(ctx: click.Context, /, **options: Any) -> None:
    """Serve the robot until Ctrl-C."""
    from robotd.cli.run import RunOptions, run_robot

    _configure_logging(ctx)
    ctx.exit(run_robot(RunOptions(**options, ros_args=ros_args(ctx))))


@main.command("check")
@robot_options
@log_options
@click.pass_context
def check(ctx: click.Context, /, **options: Any) -> None:
    """Check a robot's files and plugins, without hardware and without ROS."""
    from robotd.cli.check import check_robot

    _configure_logging(ctx)
    ctx.exit(check_robot(**options))


@main.command("robots")
@as_json
@log_options
@click.pass_context
def robots(ctx: click.Context, *, as_json: bool) -> None:
    """List the robots that can be run."""
    from robotd.cli.listing import list_robots

    _configure_logging(ctx)
    list_robots(as_json=as_json)


@main.command("backends")
@as_json
@log_options
@click.pass_context
def backends(ctx: click.Context, *, as_json: bool) -> None:
    """List the installed backends, and why one cannot load."""
    from robotd.cli.listing import list_backends

    _configure_logging(ctx)
    list_backends(as_json=as_json)


@main.command("nodes")
@as_json
@log_options
@click.pass_context
def nodes(ctx: click.Context, *, as_json: bool) -> None:
    """List the ROS nodes that a robot can name."""
    from robotd.cli.listing import list_nodes

    _configure_logging(ctx)
    list_nodes(as_json=as_json)
