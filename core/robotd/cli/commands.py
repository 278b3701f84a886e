"""Every command with its options. What a command does is in the file of its name."""

from __future__ import annotations

import gc
from pathlib import Path
from typing import Any

import click

from robotd.cli.author_commands import AUTHOR_COMMANDS
from robotd.cli.client_commands import CLIENT_COMMANDS
from robotd.cli.export import TARGETS, namespace
from robotd.cli.group import RobotdGroup, ros_args
from robotd.cli.options import (
    as_json,
    configure_logging,
    log_options,
    names,
    not_nan,
    robot_options,
    which_robot,
)
from robotd.cli.sim_commands import sim
from robotd.cli.time_scale import time_scale

# Nothing but click is imported up here: `robotd --help` must not wait for numpy or ROS.

RATE_HZ = click.FloatRange(10, 2000)  # the limits of cycle.rate_hz in a descriptor


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
@click.option("--nodes", metavar="A,B", callback=names, help="Only these of the robot's nodes.")
@click.option(
    "--rate",
    "rate_hz",
    metavar="HZ",
    type=RATE_HZ,
    callback=not_nan,
    help="Short for --set cycle.rate_hz=HZ, 10 to 2000; by default the robot's own.",
)
@click.option(
    "--report",
    metavar="FILE",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Write the timing of the last periods there, as JSON, when stopped.",
)
@time_scale
@click.option(
    "--scenario",
    metavar="FILE",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Simulation: let the faults of the file happen.",
)
@log_options
@click.pass_context
def run(ctx: click.Context, /, **options: Any) -> None:
    """Serve the robot until Ctrl-C."""
    gc.disable()  # until the robot has started: what start-up makes stays, 60 ms for nothing
    from robotd.cli.run import RunOptions, run_robot

    configure_logging(ctx)
    ctx.exit(run_robot(RunOptions(**options, ros_args=ros_args(ctx))))


@main.command("check")
@robot_options
@log_options
@click.pass_context
def check(ctx: click.Context, /, **options: Any) -> None:
    """Check a robot's files and plugins, without hardware and without ROS."""
    from robotd.cli.check import check_robot

    configure_logging(ctx)
    ctx.exit(check_robot(**options))


@main.command("export")
@click.argument("target", type=click.Choice(TARGETS))
@which_robot
@click.option(
    "--namespace",
    metavar="NS",
    default="/",
    callback=namespace,
    help="ROS namespace that the robot runs in; by default none.",
)
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    type=click.File("w", encoding="utf-8", lazy=True),
    default="-",
    help="Write there instead of to standard output.",
)
@log_options
@click.pass_context
def export(ctx: click.Context, /, **options: Any) -> None:
    """Print the configuration of a client of the robot, or its URDF."""
    from robotd.cli.export import export_robot

    configure_logging(ctx)
    export_robot(**options)


@main.command("robots")
@as_json
@log_options
@click.pass_context
def robots(ctx: click.Context, *, as_json: bool) -> None:
    """List the robots that can be run."""
    from robotd.cli.listing import list_robots

    configure_logging(ctx)
    list_robots(as_json=as_json)


@main.command("backends")
@as_json
@click.option("--check", "checked", metavar="NAME", help="Examine one backend, without hardware.")
@log_options
@click.pass_context
def backends(ctx: click.Context, *, as_json: bool, checked: str | None) -> None:
    """List the installed backends, and why one cannot load."""
    configure_logging(ctx)
    if checked is not None:
        from robotd.cli.doctor import check_backend

        ctx.exit(check_backend(checked))
    from robotd.cli.listing import list_backends

    list_backends(as_json=as_json)


@main.command("nodes")
@as_json
@log_options
@click.pass_context
def nodes(ctx: click.Context, *, as_json: bool) -> None:
    """List the ROS nodes that a robot can name."""
    from robotd.cli.listing import list_nodes

    configure_logging(ctx)
    list_nodes(as_json=as_json)


for command in (*CLIENT_COMMANDS, *AUTHOR_COMMANDS, sim):
    main.add_command(command)
