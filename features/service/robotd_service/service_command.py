"""``robotd service``: a robot as a service of systemd."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from robotd.api import InvalidArgument, OperationError
from robotd.api.commands import IntegerRange, log_options, robot_options, warn
from robotd_service.health_command import HEALTH_PORT
from robotd_service.unit_file import ETC, ServiceUnit, environment_text, is_in_home

if TYPE_CHECKING:  # it needs NumPy and pydantic
    from robotd.api.models import Override

UNITS = "/etc/systemd/system"
# Of the shell that installs: where ROS is, and how its processes find each other.
KEPT = re.compile(
    r"ROS_(?!ARGS)\w+|RMW_\w+|FASTDDS_\w+|FASTRTPS_\w+|CYCLONEDDS_\w+|AMENT_PREFIX_PATH|PYTHONPATH"
    r"|LD_LIBRARY_PATH"
)
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")


@click.group()
def service() -> None:
    """Services of systemd that run robots."""


@service.command()
@robot_options
@click.option("--name", metavar="NAME", help="Of the service robotd-NAME.  [default: the robot's]")
@click.option("--namespace", metavar="NAME", default="", help="ROS namespace of its nodes.")
@click.option(
    "--user", metavar="USER", default="robotd", show_default=True, help="User that it runs as."
)
@click.option(
    "--health",
    metavar="PORT",
    type=IntegerRange(0, 65535),
    default=HEALTH_PORT,
    show_default=True,
    help="Port of 'robotd health'; another one for each robot of the computer.",
)
@click.option("--print", "prints", is_flag=True, help="Print the unit; write nothing.")
@click.option(
    "--root",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("/"),
    help="Write below this folder, for images.",
)
@log_options
def install(
    robot: str,
    backend: str | None,
    variant: str | None,
    overrides: Sequence[Override],
    name: str | None,
    namespace: str,
    user: str,
    health: int,
    root: Path,
    *,
    prints: bool,
) -> None:
    """Write the unit of a robot, hardened, and its environment file.

    The unit restarts a robot that fails, and one whose control loop hangs. Servos stay off at each
    start until 'robotd servo on'. The variables of ROS in this shell go to the environment file,
    unless there is one. Nothing is started: the commands for that are printed.
    """
    unit = _unit(robot, backend, variant, overrides, name, namespace, user, health)
    if prints:
        click.echo(unit.text, nl=False)
        return
    kept = sorted(each for each in os.environ.items() if KEPT.fullmatch(each[0]) and each[1])
    environment = root / ETC.lstrip("/") / f"{unit.name}.env"
    unit_path = root / UNITS.lstrip("/") / unit.file_name
    try:
        unit_path.parent.mkdir(parents=True, exist_ok=True)
        unit_path.write_text(unit.text, "utf-8")
        environment.with_suffix(".d").mkdir(parents=True, exist_ok=True)
        if not environment.exists():
            environment.write_text(environment_text(kept), "utf-8")
    except OSError as error:
        raise OperationError(f"{error.filename}: {error.strerror}; run it with sudo") from error
    click.echo(f"{unit_path}\n{environment}\n")
    click.echo("\n".join(_next_steps(unit)))


def _unit(
    robot: str,
    backend: str | None,
    variant: str | None,
    overrides: Sequence[Override],
    name: str | None,
    namespace: str,
    user: str,
    health: int,
) -> ServiceUnit:
    """Return the unit. Raises RobotdError where robot or backend are wrong."""
    from robotd.api.commands import check_backend_overrides, load_robot
    from robotd.api.robots import load_backend

    descriptor = load_robot(robot, variant, overrides)
    chosen = load_backend(backend or descriptor.backend)
    check_backend_overrides(overrides, chosen.name)
    chosen.context(descriptor)
    name = name or descriptor.name
    if not NAME.fullmatch(name):
        raise InvalidArgument(f"--name {name!r}: letters, digits, '.', '_' and '-' only")
    python = Path(sys.executable)
    command = [str(python), "-m", "robotd", "run"]
    command += ["--robot", str(Path(robot).resolve()) if Path(robot).is_file() else robot]
    command += ["--backend", chosen.name]
    command += ["--variant", variant] if variant else []
    command += [word for each in overrides for word in ("--set", each.text)]
    command += ["--set", "engine.enable_at_start=false", "--health", str(health)]
    command += ["--log-format", "json"]
    ros = ["--ros-args", "-r", f"__ns:=/{namespace.strip('/')}"] if namespace else []
    return ServiceUnit(
        name=name,
        description=f"robotd: {descriptor.name} on {chosen.name}",
        command=command,
        ros_args=ros,
        user=user,
        realtime_priority=descriptor.cycle.realtime_priority,
        niceness=descriptor.cycle.niceness,
        shutdown_s=descriptor.engine.shutdown_s,
        linux_capabilities=chosen.info.linux_capabilities,
        home=is_in_home(python) or is_in_home(python.resolve()),
    )


def _next_steps(unit: ServiceUnit) -> list[str]:
    if unit.user != "root" and Path(sys.executable).resolve().is_relative_to("/root"):
        warn(f"this Python is below /root, which is closed to the user {unit.user}: install robotd")
        warn("in an environment such as /opt/robotd, or give --user root")
    steps = [
        f"useradd --system --no-create-home {unit.user}" if unit.user != "root" else "",
        "systemctl daemon-reload",
        f"systemctl enable --now {unit.file_name}",
        f"systemctl status {unit.file_name}",
    ]
    return ["Then, as root:", *(f"  {step}" for step in steps if step)]
