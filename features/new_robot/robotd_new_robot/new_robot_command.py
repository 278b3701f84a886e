"""``robotd new-robot``: write a robot's folder from its URDF."""

from __future__ import annotations

import json
import re
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import Any

import click

from robotd.api import InvalidArgument, RobotdError, scan_network
from robotd.api.commands import (
    FOLDER,
    ExitCode,
    NumberRange,
    check_robot,
    columns,
    import_ros,
    load_robot,
    parse_names,
)
from robotd.api.models import is_xacro, read_urdf_text, urdf_text, xml_root
from robotd_new_robot import (
    Choices,
    RobotPlan,
    bus_robot_files,
    plan_robot,
    plan_rows,
    robot_files,
)
from robotd_new_robot.answers import ALL
from robotd_new_robot.bus_axes import bus_options, read_bus_scan
from robotd_new_robot.joint_roles import GripperDrive
from robotd_new_robot.mesh_places import place_meshes
from robotd_new_robot.open_question import OpenQuestion
from robotd_new_robot.wheels import BaseKind
from robotd_new_robot.xacro_file import expand_xacro
from robotd_ros.commands.robot_client import client_options, require_one_robot, robot_client
from robotd_shared.package_templates import package_files, package_words, write_folder

FOUR_WHEELED = (BaseKind.SKID_STEER, BaseKind.MECANUM)
TEMPLATES = Path(__file__).parent / "templates" / "robot"
EPILOG = """\b
Examples:
  robotd new-robot my_arm --urdf my_arm.urdf
  robotd new-robot rover --urdf rover.urdf --wheels left_wheel,right_wheel --wheel-radius 0.1
  robotd new-robot rover --urdf rover.urdf --base mecanum
  robotd new-robot skid --urdf skid.urdf --wheels front_left,rear_left,front_right,rear_right
  robotd canopen scan --channel can0 --json > bus.json
  robotd new-robot my_arm --urdf my_arm.urdf --bus bus.json
  robotd new-robot axes --bus bus.json   # without a URDF: a joint for each drive
  robotd new-robot axes --bus feetech:/dev/ttyACM0   # scans the bus itself
  robotd new-robot my_arm --extends so101 --bus feetech:/dev/ttyACM0
  robotd new-robot my_arm --urdf my_arm.urdf --srdf my_arm.srdf --copy-meshes
  robotd new-robot my_arm --urdf my_arm.urdf --package
  robotd new-robot cell7 --extends cr3a
  robotd new-robot my_arm                # the URDF that a running system publishes
"""


def _answers(
    ctx: click.Context, option: click.Parameter, values: Sequence[str]
) -> dict[str, tuple[float, ...]]:
    """Parse texts such as ``JOINT=LOWER,UPPER``; without a joint the key is ``ALL``."""
    form = str(option.metavar)
    count = form.count(",") + 1
    found = {}
    for text in values:
        joint, _, numbers = text.rpartition("=")
        try:
            answer = tuple(float(number) for number in numbers.split(","))
        except ValueError:
            answer = ()
        if len(answer) != count or not all(map(isfinite, answer)):
            raise click.BadParameter(f"{text!r} is not {form}")
        if answer[0] >= answer[1] if count == 2 else answer[0] <= 0.0:
            what = "the lower limit is not below the upper one" if count == 2 else "must be above 0"
            raise click.BadParameter(f"{text!r}: {what}")
        found[joint or ALL] = answer
    return found


def _xacro_arguments(
    ctx: click.Context, option: click.Parameter, values: Sequence[str]
) -> dict[str, str]:
    pairs = [text.partition(":=") for text in values]
    for name, sign, _ in pairs:
        if not name or not sign:
            raise click.BadParameter(f"{name!r} is not NAME:=VALUE")
    return {name: value for name, _, value in pairs}


@click.command("new-robot", epilog=EPILOG)
@click.argument("name")
@click.option(
    "--urdf",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="URDF or xacro file of the robot; without --bus the default is the topic"
    " /robot_description of a running system.",
)
@click.option(
    "--xacro-arg",
    "xacro_arguments",
    metavar="NAME:=VALUE",
    multiple=True,
    callback=_xacro_arguments,
    help="Argument of a URDF in xacro, which the Python package xacro expands. May be repeated.",
)
@click.option(
    "--srdf",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="SRDF of a MoveIt configuration: names of the joint groups, and passive joints.",
)
@click.option(
    "--meshes",
    metavar="FOLDER",
    type=click.Path(path_type=Path, exists=True, file_okay=False),
    multiple=True,
    help="Folder with meshes, or packages of a xacro file, that are neither beside the file nor in"
    " AMENT_PREFIX_PATH. May be repeated.",
)
@click.option("--copy-meshes", is_flag=True, help="Copy the meshes into the robot's folder.")
@click.option(
    "--bus",
    metavar="FILE|BACKEND:ADDRESS",
    help="Drives of the robot: output of a backend's 'scan --json', or a bus to scan, such as"
    " dynamixel:/dev/ttyUSB0 or canopen:can0. Without --urdf they are the robot: one joint for each"
    " drive. With --extends it names backend and address.",
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
    callback=parse_names,
    help="Joints of the driven wheels, all left ones first; by default those that a level axis, a"
    " round shape and their place on the ground, or their names, show as wheels.",
)
@click.option(
    "--base",
    "kind",
    type=click.Choice([str(kind) for kind in FOUR_WHEELED]),
    help="Kind of a base on four wheels or more, which a URDF seldom shows; asked for on a"
    " terminal. With --wheels the default is skid_steer.",
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
    help="Fingers are moved by a valve on an output, by an axis of their own, or by nothing; asked"
    " for on a terminal, else 'output'. A single jaw has an axis.",
)
@click.option(
    "--speed",
    "speeds",
    metavar="[JOINT=]SPEED",
    multiple=True,
    callback=_answers,
    help="Speed of a joint, or of all joints without one in the URDF, rad/s or m/s; by default"
    " 0.5 rad/s and 0.05 m/s. May be repeated.",
)
@click.option(
    "--limits",
    metavar="[JOINT=]LOWER,UPPER",
    multiple=True,
    callback=_answers,
    help="Limits of a joint, or of all joints without a range in the URDF, rad or m. May be"
    " repeated.",
)
@click.option(
    "--passive",
    metavar="JOINT,...",
    callback=parse_names,
    help="Joints that no axis moves: caster forks, suspensions, rockers.",
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
    explain each choice. What was understood is listed joint by joint. What the URDF leaves open
    is asked for on a terminal, and has an option. Every problem of the URDF is reported with its
    line, and nothing is written.
    """
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        raise InvalidArgument(
            f"robot name {name!r}: must begin with a letter and hold only letters, digits and _"
        )
    words = package_words(name)
    top = into / (words["distribution"] if package else name)
    if top.exists():
        raise RobotdError(f"folder {top} exists already")
    folder = top / words["package"] / "robots" / name if package else top
    files: dict[str, bytes | Path] = {}
    with tempfile.TemporaryDirectory() as scans:
        bus = _bus_file(options["bus"], Path(scans))
        summary = _fill(files, name, folder, options, bus)
    inside = folder.relative_to(top)
    whole = {str(inside / file): content for file, content in files.items()}
    write_folder(top, whole | (package_files(TEMPLATES, words) if package else {}))
    click.echo(f"{folder} is a robot: {', '.join(file for file in files if '/' not in file)}")
    click.echo("\n".join(summary))
    status = check_robot(str(folder / "robot.yaml"), None, (), None)
    if status == ExitCode.OK:
        _show_next(name, folder, top if package else None)
    return status


def _fill(
    files: dict[str, bytes | Path],
    name: str,
    folder: Path,
    options: Mapping[str, Any],
    bus: Path | None,
) -> list[str]:
    """Add the files of the robot; return lines about its meshes and joints."""
    if options["extends"]:
        files["robot.yaml"] = _extension(name, options["extends"], bus)
    elif bus and not options["urdf"]:
        files |= bus_robot_files(name, bus, options["ramp_s"])
    else:
        text, path = _urdf_text(options)
        urdf = folder / f"{name}.urdf"
        placed = place_meshes(text, path, urdf, options["meshes"], copy=options["copy_meshes"])
        plan = _plan(placed.text, path, options)
        files |= robot_files(name, plan, bus)
        files |= placed.files
        return [*filter(None, [placed.summary]), "", *columns(plan_rows(plan)), ""]
    return [""]


def _plan(text: str, path: Path, options: Mapping[str, Any]) -> RobotPlan:
    """Return what is understood of the URDF; on a terminal a person answers what it leaves open."""
    choices, srdf = _choices(options), options["srdf"]
    if not _is_interactive():
        return plan_robot(text, path, choices, srdf)
    gripper = options["gripper"]
    while True:
        try:
            plan = plan_robot(text, path, choices, srdf)
        except OpenQuestion as question:
            number = NumberRange(0, min_open=True)
            kind = click.Choice([*map(str, question.choices)]) if question.choices else number
            answer = click.prompt(question.question, default=question.default, type=kind)
            if question.choices:
                answer = BaseKind(answer)
            choices = replace(choices, **{question.option: answer})
            continue
        if plan.roles.fingers is None or gripper:
            return plan
        names = ", ".join(joint.name for joint in plan.roles.fingers.joints)
        gripper = click.prompt(
            f"The fingers {names} are moved by an output (a valve), an axis, or none",
            default=str(choices.gripper),
            type=click.Choice([*map(str, GripperDrive)]),
        )
        choices = replace(choices, gripper=GripperDrive(gripper))


def _is_interactive() -> bool:
    """Return True if a person can answer a prompt."""
    return sys.stdin.isatty() and sys.stdout.isatty()


def _show_next(name: str, folder: Path, package: Path | None) -> None:
    """Print the next steps; ``package`` is the folder of a package to install."""
    robot = f"{folder}/robot.yaml" if package is None else name
    if package is not None:
        click.echo(f"\nInstall it:\n\n  pip install --editable {package}")
    click.echo(f"\nRun it on the simulation:\n\n  robotd run --robot {robot}")
    click.echo(f"\nWhat was chosen, and why: {folder}/robot.yaml")


def _bus_file(bus: str | None, folder: Path) -> Path | None:
    """Return the file of a bus; ``BACKEND:ADDRESS`` is scanned into one in ``folder``."""
    if bus is None:
        return None
    backend, separator, address = bus.partition(":")
    if not separator or Path(bus).exists():
        return Path(bus)
    path = folder / f"{backend} {address.replace('/', ' ').strip()}"
    install = f"pip install 'robotd[{backend}]'"
    path.write_text(json.dumps(scan_network(backend, {"address": address}, install)))
    return path


def _extension(name: str, base: str, bus: Path | None) -> bytes:
    """Return the ``robot.yaml`` of a robot that extends ``base``, which is installed.

    ``bus``: scan whose backend and options it has; the drives are those of ``base``.
    """
    load_robot(base)
    scan = read_bus_scan(bus) if bus else None
    section = () if scan is None else bus_options(scan)
    lines = (
        f"# {name} is {base}, except for what is stated here: mappings merge key by key, scalars",
        "# and lists replace, null restores a default (robotd docs reference/descriptor).",
        "schema: 1",
        f"name: {name}",
        f"extends: {base}",
        f'summary: "{name}, as {base}"',
        *section,
        "",
    )
    return "\n".join(lines).encode()


def _choices(options: Mapping[str, Any]) -> Choices:
    return Choices(
        wheels=tuple(options["wheels"] or ()),
        kind=BaseKind(options["kind"]) if options["kind"] else None,
        wheel_radius_m=options["wheel_radius_m"],
        base=not options["no_base"],
        groups=not options["no_groups"],
        gripper=GripperDrive(options["gripper"] or GripperDrive.OUTPUT),
        ramp_s=options["ramp_s"],
        speeds={joint: speed for joint, (speed,) in options["speeds"].items()},
        limits=options["limits"],
        passive=tuple(options["passive"] or ()),
    )


def _urdf_text(options: Mapping[str, Any]) -> tuple[str, Path]:
    """Return the URDF and the name of its origin."""
    path: Path | None = options["urdf"]
    if path is not None:
        text = read_urdf_text(path)
        if is_xacro(xml_root(text, path)):
            expanded = expand_xacro(path, options["xacro_arguments"], options["meshes"])
            path = path.with_name(f"{path.name}, expanded")  # lines are not those of the file
            text = urdf_text(expanded, path)
        return text, path
    with robot_client(options["timeout_s"]) as client:
        require_one_robot(client)
        text = import_ros("robotd_ros.client.status_client").read_description(client)
    path = Path("robot_description")
    return urdf_text(text, path), path
