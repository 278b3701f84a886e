"""``robotd new-backend``: write a backend package from the templates."""

from __future__ import annotations

import re
from pathlib import Path

import click

from robotd.api import InvalidArgument
from robotd.api.commands import FOLDER, log_options
from robotd.api.robots import discover
from robotd_shared.package_templates import package_files, package_words, write_folder

TEMPLATES = Path(__file__).parent / "templates"


@click.command("new-backend")
@click.argument("name")
@click.option(
    "--into",
    metavar="FOLDER",
    type=FOLDER,
    default=Path(),
    help="Where the package's folder is made; by default here.",
)
@click.option(
    "--minimal",
    is_flag=True,
    help="One module that moves axes by streamed targets, instead of a package with everything.",
)
@log_options
def new_backend(name: str, into: Path, *, minimal: bool) -> None:
    """Write an installable backend package that passes the checks, to start from."""
    write_backend(name, into, minimal=minimal)


def write_backend(name: str, into: Path, *, minimal: bool = False) -> None:
    """Write the package ``robotd-NAME`` into a new folder, and print the next steps.

    ``minimal``: one module with axes, instead of a package with one file for each contract.

    Raises:
        InvalidArgument: the name is not one, or is taken by an installed backend.
        RobotdError: the folder exists, or cannot be written.
    """
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise InvalidArgument(
            f"backend name {name!r}: must be lower-case letters, digits and _, a letter first"
        )
    taken = [origin for origin, _ in discover() if origin.name == name]
    if taken:
        raise InvalidArgument(f"backend name {name!r} is taken by {taken[0]}")
    words = package_words(name)
    folder = into / words["distribution"]
    write_folder(folder, package_files(TEMPLATES / ("minimal" if minimal else "backend"), words))
    click.echo(f"{folder} is a backend that moves imaginary drives. Install it and check it:\n")
    click.echo(f"  pip install --editable {folder}\n  robotd conform --backend {name}\n")
    replaces = f"{words['package']}.py: replace the class Controller" if minimal else "README.md"
    click.echo(f"What to replace by your hardware: {replaces}.")
