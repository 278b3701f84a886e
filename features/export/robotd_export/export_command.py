"""``robotd export``: configuration of a robot's clients, in their own formats.

Targets are functions in the entry-point group ``robotd.exports``, by the name of the target. Each
takes an ``ExportInput`` and returns the text, or the files of a folder by their paths; it raises
DescriptorError where the robot has nothing for the target. A function is imported when its target
is asked for.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import click

from robotd.api import PluginError, unknown_name
from robotd.api.commands import (
    installed_names,
    load_entry,
    load_installed,
    log_options,
    plugin_errors,
    which_robot,
)
from robotd.api.models import Override, load_robot_descriptor
from robotd_export.export_input import ExportInput
from robotd_shared.package_templates import write_folder

EXPORTS = "robotd.exports"

Export = Callable[[ExportInput], str | Mapping[str, str]]


def export_targets() -> list[str]:
    """Return the names of all targets; imports none."""
    return [*installed_names(EXPORTS).entries]


def export_function(target: str) -> Export:
    """Import the function of a target. What it raises besides RobotdError is PluginError.

    Raises PluginError: no distribution has it, or it cannot be imported.
    """
    found = installed_names(EXPORTS).require(target)
    if found is None:
        raise PluginError(unknown_name("export", target, export_targets()))
    function: Export = load_entry(*found)

    def export_with(given: ExportInput) -> str | Mapping[str, str]:
        with plugin_errors(f"export {found[0]}", found[0].module):
            made: object = function(given)
            if isinstance(made, Mapping) and all(
                isinstance(result, str) for result in made.values()
            ):
                return dict(made)
            if not isinstance(made, str):
                raise TypeError(f"returned {type(made).__name__}, no text and no texts by path")
        return made

    return export_with


def namespace(ctx: click.Context, option: click.Parameter, value: str) -> str:
    """Normalize a namespace: ``left`` → ``/left``, "" → ``/``."""
    words = value.strip("/").split("/") if value.strip("/") else []
    for word in words:
        if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", word):
            raise click.BadParameter(f"{value!r} is not a ROS namespace")
    return "/" + "/".join(words)


@click.command("export")
@click.argument("target", type=click.Choice(export_targets()))
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
    metavar="FILE|FOLDER",
    type=click.Path(path_type=Path),
    help="Write there instead of to standard output; 'moveit_package' makes a new folder.",
)
@log_options
def export(
    target: str,
    robot: str,
    variant: str | None,
    overrides: Sequence[Override],
    namespace: str,
    output: Path | None,
) -> None:
    """Print the configuration of a client of the robot, or its URDF."""
    installed = load_installed()
    installed.warn()
    descriptor = load_robot_descriptor(robot, variant, installed.search_path, overrides)
    exported = export_function(target)(ExportInput(descriptor, namespace))
    if not isinstance(exported, str):
        if output is None:
            raise click.BadParameter(f"{target} is a folder: name one", param_hint="'--output'")
        write_folder(output, {name: text.encode() for name, text in exported.items()})
        click.echo(f"{output}: {', '.join(exported)}", err=True)
    elif output is None or str(output) == "-":
        click.echo(exported, nl=False)
    else:
        _write(output, exported)


def _write(output: Path, text: str) -> None:
    try:
        output.write_text(text, encoding="utf-8")
    except OSError as error:
        what = f"Could not open file {str(output)!r}: {error.strerror}"
        raise click.BadParameter(what, param_hint="'--output'") from error
