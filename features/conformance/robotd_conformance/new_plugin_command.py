"""``robotd new-plugin``: write a package of one kind of plugin from the templates."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import click

from robotd.api import InvalidArgument
from robotd.api.bases import DriveSettings
from robotd.api.commands import FOLDER, installed_names, load_installed, log_options
from robotd.api.features import installed_features
from robotd.api.models import RobotDescriptor, list_robots
from robotd_conformance.new_backend_command import TEMPLATES, write_backend
from robotd_shared.package_templates import package_files, package_words, write_folder

KINDS = {
    "backend": "drives a device",
    "base": "a kind of mobile base",
    "feature": "runs alongside a robot and observes it",
    "node": "a ROS node that a robot's file can name",
    "robot": "files of robots",
}


@click.command("new-plugin")
@click.argument("kind", type=click.Choice([*KINDS]))
@click.argument("name")
@click.option(
    "--into",
    metavar="FOLDER",
    type=FOLDER,
    default=Path(),
    help="Where the package's folder is made; by default here.",
)
@log_options
def new_plugin(kind: str, name: str, into: Path) -> None:
    """Write an installable package of one kind of plugin, with tests, to start from."""
    if kind == "backend":
        write_backend(name, into)
        return
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        what = "must be lower-case letters, digits and _, a letter first"
        raise InvalidArgument(f"{kind} name {name!r}: {what}")
    if name in TAKEN[kind]():
        raise InvalidArgument(f"{kind} name {name!r} is taken; see 'robotd plugins'")
    words = package_words(name) | {"flag": name.replace("_", "-")}
    folder = into / words["distribution"]
    write_folder(folder, package_files(TEMPLATES / kind, words))
    click.echo(f"{folder} is a {kind} that works. Install it and check it:\n")
    click.echo(f"  pip install --editable {folder}")
    click.echo(f"  robotd plugins --check {words['distribution']}\n")
    click.echo(f"What to do next: {folder / 'README.md'}")


def _keys() -> set[str]:
    own = {field.alias or name for name, field in RobotDescriptor.model_fields.items()}
    return own.union(*(feature.keys for feature in installed_features().values()))


def _nodes() -> set[str]:
    nodes = load_installed().nodes
    return {*nodes.nodes, *nodes.served}


def _bases() -> set[str]:
    return {*installed_names("robotd.bases").entries, *DriveSettings.model_fields}


def _robots() -> set[str]:
    return {robot.name for robot in list_robots(load_installed().search_path)}


TAKEN: dict[str, Callable[[], set[str]]] = {
    "base": _bases,
    "feature": _keys,
    "node": _nodes,
    "robot": _robots,
}
"""Names of each kind that are taken."""
