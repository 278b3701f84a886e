"""``robotd export``: what clients have to know of a robot, in their own form."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, TextIO

import click

if TYPE_CHECKING:
    from robotd.descriptor import Override

# The keys of robotd.export.EXPORTS, which is not imported for `robotd --help`.
TARGETS = ("moveit", "nav2", "isaac", "urdf")


def namespace(ctx: click.Context, option: click.Parameter, value: str) -> str:
    """``left`` and ``/left`` → ``/left``; nothing and ``/`` → ``/``."""
    words = value.strip("/").split("/") if value.strip("/") else []
    for word in words:
        if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", word):
            raise click.BadParameter(f"{value!r} is not a ROS namespace")
    return "/" + "/".join(words)


def export_robot(
    target: str,
    robot: str,
    variant: str | None,
    overrides: Sequence[Override],
    namespace: str,
    output: TextIO,
) -> None:
    """Write one export of a robot. Raises DescriptorError where it does not apply."""
    from robotd.cli.catalogue import load_catalogue
    from robotd.descriptor import load_robot_descriptor
    from robotd.export import EXPORTS, ExportInput

    catalogue = load_catalogue()
    catalogue.warn()
    descriptor = load_robot_descriptor(robot, variant, catalogue.search_path, overrides)
    text = EXPORTS[target](ExportInput(descriptor, namespace))
    output.write(text)  # the file is opened here, so that a rejection leaves it alone
