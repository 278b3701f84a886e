"""``robotd export``: configuration of a robot's clients, in their own formats."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TextIO

import click

from robotd.cli.installed import load_installed
from robotd.cli.options import log_options, which_robot
from robotd.descriptor import Override, load_robot_descriptor
from robotd_export.export_input import ExportInput
from robotd_export.targets import export_function, export_targets


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
    metavar="FILE",
    type=click.File("w", encoding="utf-8", lazy=True),
    default="-",
    help="Write there instead of to standard output.",
)
@log_options
def export(
    target: str,
    robot: str,
    variant: str | None,
    overrides: Sequence[Override],
    namespace: str,
    output: TextIO,
) -> None:
    """Print the configuration of a client of the robot, or its URDF."""
    installed = load_installed()
    installed.warn()
    descriptor = load_robot_descriptor(robot, variant, installed.search_path, overrides)
    text = export_function(target)(ExportInput(descriptor, namespace))
    try:
        output.write(text)  # the file is opened here, so that a rejection leaves it alone
    except click.FileError as error:
        raise click.BadParameter(error.format_message(), param_hint="'--output'") from error
