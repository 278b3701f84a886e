"""Options that several commands have."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from robotd.descriptor import Override

LOG_LEVELS = ("debug", "info", "warning", "error")
LOG_FORMATS = ("console", "json")

Command = Callable[..., Any]


def names(ctx: click.Context, option: click.Parameter, value: str | None) -> list[str] | None:
    """``a,b`` → ``[a, b]``; None when the option is not given."""
    if value is None:
        return None
    words = [word.strip() for word in value.split(",") if word.strip()]
    if not words:
        raise click.BadParameter("no name given")
    return list(dict.fromkeys(words))


def not_nan(ctx: click.Context, option: click.Parameter, value: float | None) -> float | None:
    """The value; a limit does not hold NaN back, because no comparison with it is true."""
    if value is not None and math.isnan(value):
        raise click.BadParameter("nan is not a number")
    return value


def overrides(
    ctx: click.Context, option: click.Parameter, values: Sequence[str]
) -> tuple[Override, ...]:
    """``KEY=VALUE`` texts, parsed as values of a descriptor. Raises DescriptorError."""
    from robotd.descriptor import parse_override

    return tuple(parse_override(value) for value in values)


def configure_logging(ctx: click.Context) -> None:
    """As ``log_options`` say."""
    from robotd import log

    log.configure_logging(ctx.meta["log_level"], log.LogFormat(ctx.meta["log_format"]))


def which_robot(command: Command) -> Command:
    """Options that choose a robot: name or file, variant, and changed values."""
    for option in (
        click.option(
            "--set",
            "overrides",
            metavar="KEY=VALUE",
            multiple=True,
            callback=overrides,
            help="Replace a value of the robot's file, e.g. backends.sim.seed=7. May be repeated.",
        ),
        click.option("--variant", metavar="NAME", help="Variant of the robot; see 'robots'."),
        click.option("--robot", metavar="NAME|FILE", required=True, help="The robot."),
    ):
        command = option(command)
    return command


def robot_options(command: Command) -> Command:
    """Which robot, and what drives it."""
    backend = click.option("--backend", metavar="NAME", help="Backend; by default the robot's own.")
    return which_robot(backend(command))


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


def _keep(ctx: click.Context, option: click.Parameter, value: str) -> None:
    ctx.meta[str(option.name)] = value
