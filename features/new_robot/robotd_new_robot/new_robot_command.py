"""``robotd new-robot``: write a robot's folder from its URDF."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from robotd.cli.check_command import check_robot
from robotd.cli.exit_codes import ExitCode
from robotd.cli.installed import load_robot
from robotd.cli.options import FOLDER, names
from robotd.cli.package_templates import package_words, write_files, write_package
from robotd.cli.preflight import import_ros
from robotd.descriptor.files import read_limited
from robotd.descriptor.urdf import declared_as_utf8, parse_urdf
from robotd.descriptor.urdf.urdf_text import MAX_BYTES
from robotd.errors import InvalidArgument, OperationError
from robotd.number_argument import NumberRange
from robotd_new_robot import Choices, bus_robot_files, robot_files
from robotd_new_robot.joint_roles import GripperDrive
from robotd_ros.commands.robot_client import client_options, robot_client

TEMPLATES = Path(__file__).parent / "templates" / "robot"
EPILOG = """\b
Examples:
  robotd new-robot my_arm --urdf my_arm.urdf
  robotd new-robot rover --urdf rover.urdf --wheels left_wheel,right_wheel --wheel-radius 0.1
  robotd new-robot skid --urdf skid.urdf --wheels front_left,rear_left,front_right,rear_right
  robotd canopen scan --channel can0 --json > bus.json
  robotd new-robot my_arm --urdf my_arm.urdf --bus bus.json
  robotd new-robot axes --bus bus.json   # without a URDF: a joint for each drive
  robotd new-robot my_arm --urdf my_arm.urdf --package
  robotd new-robot cell7 --extends cr3a
  robotd new-robot my_arm                # the URDF that a running system publishes
"""


@click.command("new-robot", epilog=EPILOG)
@click.argument("name")
@click.option(
    "--urdf",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="URDF of the robot; without --bus the default is the topic /robot_description of a running"
    " system.",
)
@click.option(
    "--bus",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="Drives of the robot: output of 'scan --json' of robotd canopen, ethercat or wmx."
    " Without --urdf they are the robot: one joint for each drive.",
)
@click.option(
    "--extends",
    metavar="NAME",
    help="Robot that the new one extends, instead of a URDF.",
)
@click.option(
    "--package",
    is_flag=True,
    help="Write an installable package that holds the robot, with a test.",
)
@click.option(
    "--into",
    metavar="FOLDER",
    type=FOLDER,
    default=Path(),
    help="Where the robot's folder is made; by default here.",
)
@click.option(
    "--wheels",
    metavar="LEFT,...,RIGHT,...",
    callback=names,
    help="Joints of the driven wheels, all left ones first; by default the two continuous joints"
    " named like wheels. Several wheels a side make a skid-steer base.",
)
@click.option(
    "--wheel-radius",
    "wheel_radius_m",
    metavar="METRES",
    type=NumberRange(0, min_open=True),
    help="Radius of the wheels; by default that of their cylinders in the URDF.",
)
@click.option("--no-base", is_flag=True, help="No joint is a wheel.")
@click.option(
    "--no-groups", is_flag=True, help="All joints are one group; by default each branch is one."
)
@click.option(
    "--gripper",
    type=click.Choice([*map(str, GripperDrive)]),
    default=str(GripperDrive.OUTPUT),
    show_default=True,
    help="Fingers are moved by a valve on an output, by an axis of their own, or by nothing.",
)
@click.option(
    "--ramp-time",
    "ramp_s",
    metavar="SECONDS",
    type=NumberRange(0.01, 60),
    default=0.25,
    show_default=True,
    help="Time to full speed, which gives the accelerations.",
)
@client_options
def new_robot(*, name: str, into: Path, package: bool, **options: Any) -> ExitCode:
    """Write a robot's folder from its URDF or its drives, ready for the simulation.

    Limits, names, gripper, wheels and drive models are taken from the URDF; comments in robot.yaml
    explain each choice. Every problem of the URDF is reported with its line, and nothing is
    written.
    """
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        raise InvalidArgument(
            f"robot name {name!r}: must begin with a letter and hold only letters, digits and _"
        )
    words = package_words(name)
    top = into / (words["distribution"] if package else name)
    if top.exists():
        raise OperationError(f"folder {top} exists already")
    if options["extends"]:
        files = {"robot.yaml": _extension(name, options["extends"])}
    elif options["bus"] and not options["urdf"]:
        files = bus_robot_files(name, options["bus"], options["ramp_s"])
    else:
        text, path = _urdf_text(options["urdf"], options["timeout_s"])
        urdf = parse_urdf(text, path)
        files = robot_files(name, urdf, text, path, _choices(options), options["bus"])
    folder = top / words["package"] / "robots" / name if package else top
    write_files(folder, files)
    if package:
        write_package(TEMPLATES, top, words)
    click.echo(f"{folder} is a robot: {', '.join(files)}\n")
    status = check_robot(str(folder / "robot.yaml"), None, (), None)
    if status == ExitCode.OK:
        _show_next(name, folder, top if package else None)
    return status


def _show_next(name: str, folder: Path, package: Path | None) -> None:
    """Print the next steps; ``package`` is the folder of a package to install."""
    robot = f"{folder}/robot.yaml" if package is None else name
    if package is not None:
        click.echo(f"\nInstall it:\n\n  pip install --editable {package}")
    click.echo(f"\nRun it on the simulation:\n\n  robotd run --robot {robot}")
    click.echo(f"\nWhat was chosen, and why: {folder}/robot.yaml")


def _extension(name: str, base: str) -> bytes:
    """Return the ``robot.yaml`` of a robot that extends ``base``, which is installed."""
    load_robot(base)
    lines = (
        f"# {name} is {base}, except for what is stated here: mappings merge key by key, scalars",
        "# and lists replace, null restores a default (docs/reference/descriptor.md).",
        "schema: 1",
        f"name: {name}",
        f"extends: {base}",
        f'summary: "{name}, as {base}"',
        "",
    )
    return "\n".join(lines).encode()


def _choices(options: Mapping[str, Any]) -> Choices:
    return Choices(
        wheels=tuple(options["wheels"] or ()),
        wheel_radius_m=options["wheel_radius_m"],
        base=not options["no_base"],
        groups=not options["no_groups"],
        gripper=GripperDrive(options["gripper"]),
        ramp_s=options["ramp_s"],
    )


def _urdf_text(path: Path | None, timeout_s: float) -> tuple[bytes, Path]:
    """Return the URDF and the name of its origin."""
    if path is not None:
        return read_limited(path, MAX_BYTES), path
    with robot_client(timeout_s) as client:
        text: str = import_ros("robotd_ros.client.status_client").read_description(client)
    return declared_as_utf8(text).encode(), Path("robot_description")
