"""The commands ``robotd sim ...``. What they do is in ``sim.py``."""

from __future__ import annotations

from pathlib import Path

import click

from robotd.cli.client_commands import ROS_EPILOG, client_options
from robotd.cli.group import ros_args
from robotd.cli.options import configure_logging, log_options
from robotd.cli.time_scale import time_scale

MAX_STEPS = 1_000_000


@click.group("sim")
def sim() -> None:
    """Scenarios and faults for the simulation."""


@sim.command("run")
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
@click.option("--robot", metavar="NAME|FILE", help="The robot; by default the scenario's own.")
@time_scale
@log_options
@click.pass_context
def run(ctx: click.Context, /, file: Path, robot: str | None, *, time_scale: float | None) -> None:
    """Run a scenario as a test: status 0 when all went as it expects, else 1.

    Without ROS, and as fast as the computer goes unless --time-scale says otherwise.
    """
    from robotd.cli.sim import run_scenario

    configure_logging(ctx)
    ctx.exit(run_scenario(file, robot, time_scale))


@sim.command("inject", epilog=ROS_EPILOG)
@click.argument("fault")
@click.argument("values", metavar="[KEY=VALUE]...", nargs=-1)
@client_options
@click.pass_context
def inject(ctx: click.Context, /, fault: str, values: tuple[str, ...], *, timeout_s: float) -> None:
    """Let something go wrong in the running simulation.

    For example: robotd sim inject amp_alarm axis=2 at_s=1.5. The robot has to be run with
    --time-scale or --scenario.
    """
    from robotd.cli.sim import inject_fault

    configure_logging(ctx)
    inject_fault(ros_args(ctx), timeout_s, fault, values)


@sim.command("step", epilog=ROS_EPILOG)
@click.argument("periods", type=click.IntRange(1, MAX_STEPS), default=1)
@client_options
@click.pass_context
def step(ctx: click.Context, /, periods: int, *, timeout_s: float) -> None:
    """Let PERIODS of the cycle pass in the running simulation, then let time stand."""
    from robotd.cli.sim import step_time

    configure_logging(ctx)
    step_time(ros_args(ctx), timeout_s, periods)


@sim.command("pause", epilog=ROS_EPILOG)
@client_options
@click.pass_context
def pause(ctx: click.Context, /, *, timeout_s: float) -> None:
    """Let time stand in the running simulation."""
    from robotd.cli.sim import pause_time

    configure_logging(ctx)
    pause_time(ros_args(ctx), timeout_s, paused=True)


@sim.command("resume", epilog=ROS_EPILOG)
@client_options
@click.pass_context
def resume(ctx: click.Context, /, *, timeout_s: float) -> None:
    """Let time pass again in the running simulation."""
    from robotd.cli.sim import pause_time

    configure_logging(ctx)
    pause_time(ros_args(ctx), timeout_s, paused=False)
