"""Options shared by several commands."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import partial, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robotd import log
from robotd.cli.group import ROS_ARGS
from robotd.cli.shell_values import complete_backends, complete_robots
from robotd.errors import InvalidArgument
from robotd.number_argument import IntegerRange

if TYPE_CHECKING:  # it needs NumPy and pydantic
    from robotd.descriptor import Override

Command = Callable[..., Any]

NAMESPACE = re.compile(r"/?([A-Za-z_][A-Za-z0-9_]*/)*([A-Za-z_][A-Za-z0-9_]*/?)?")

FILE = click.Path(dir_okay=False, path_type=Path)
FOLDER = click.Path(file_okay=False, path_type=Path)
PORT = IntegerRange(0, 65535)  # 0: any free one


def parse_names(ctx: click.Context, option: click.Parameter, value: str | None) -> list[str] | None:
    """Parse ``a,b`` into ``[a, b]``; None when the option is absent."""
    if value is None:
        return None
    words = [word.strip() for word in value.split(",") if word.strip()]
    if not words:
        raise click.BadParameter("no name given")
    return list(dict.fromkeys(words))


def overrides(
    ctx: click.Context, option: click.Parameter, values: Sequence[str]
) -> tuple[Override, ...]:
    """Parse ``KEY=VALUE`` texts as values of a descriptor. Raises DescriptorError."""
    if not values:  # the commands of an operator need no descriptor
        return ()
    from robotd.descriptor import parse_override

    return tuple(parse_override(value) for value in values)


def apply_log_options() -> None:
    """Configure logging from the options of ``log_options``."""
    options = click.get_current_context().meta
    log.configure_logging(options["log_level"], log.LogFormat(options["log_format"]))


def which_robot(command: Command) -> Command:
    """Add the options that choose a robot: name or file, variant, and changed values."""
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
        click.option(
            "--robot",
            metavar="NAME|FILE",
            required=True,
            shell_complete=complete_robots,
            help="The robot.",
        ),
    ):
        command = option(command)
    return command


def robot_options(command: Command) -> Command:
    """Add the options that choose a robot and its backend."""
    backend = click.option(
        "--backend",
        metavar="NAME",
        shell_complete=complete_backends,
        help="Backend; by default the robot's own.",
    )
    return which_robot(backend(command))


def log_options(command: Command) -> Command:
    """Add the options of logging; they take effect before the command runs."""
    option = partial(
        click.option, show_default=True, callback=_keep, expose_value=False, is_eager=True
    )
    levels, formats = click.Choice(log.LEVELS), click.Choice([*map(str, log.LogFormat)])

    @option("--log-level", type=levels, default="info", help="'debug' shows tracebacks too.")
    @option("--log-format", type=formats, default="console", help="Lines for people, or JSON.")
    @wraps(command)
    def configured(*args: Any, **options: Any) -> Any:
        apply_log_options()
        return command(*args, **options)

    return configured


def namespace_option(command: Command) -> Command:
    """Add ``--namespace``, short for the ROS arguments that give it to all nodes."""
    return click.option(
        "--namespace",
        metavar="NAME",
        callback=_keep_namespace,
        expose_value=False,
        help="ROS namespace of the robot; short for --ros-args -r __ns:=/NAME.",
    )(command)


def check_namespace(namespace: str) -> str:
    """Return ``namespace`` with one slash before it. Raises InvalidArgument."""
    if not NAMESPACE.fullmatch(namespace):
        what = "names of letters, digits and '_' that begin with no digit, with '/' between them"
        raise InvalidArgument(f"--namespace {namespace!r}: {what}")
    return f"/{namespace.strip('/')}"


def _keep_namespace(ctx: click.Context, option: click.Parameter, value: str | None) -> None:
    if value is None:
        return
    given = ctx.meta[ROS_ARGS] or [ROS_ARGS]
    if any("__ns:=" in word for word in given):
        raise click.UsageError("--namespace and __ns:= give the same: leave one out")
    ctx.meta[ROS_ARGS] = [given[0], "-r", f"__ns:={check_namespace(value)}", *given[1:]]


as_json = click.option("--json", "as_json", is_flag=True, help="Print JSON, for programs.")


def _keep(ctx: click.Context, option: click.Parameter, value: str) -> None:
    ctx.meta[str(option.name)] = value
