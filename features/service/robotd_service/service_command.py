"""``robotd service``: a robot as a service of systemd."""

from __future__ import annotations

import math
import os
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from robotd.api import InvalidArgument, OperationError
from robotd.api.commands import IntegerRange, log_options, robot_options, warn
from robotd_service.health_command import HEALTH_PORT

if TYPE_CHECKING:  # it needs NumPy and pydantic
    from robotd.api.models import Override

UNITS = "/etc/systemd/system"
# Of the shell that installs: where ROS is, and how its processes find each other.
KEPT = re.compile(
    r"ROS_(?!ARGS)\w+|RMW_\w+|FASTDDS_\w+|FASTRTPS_\w+|CYCLONEDDS_\w+|AMENT_PREFIX_PATH|PYTHONPATH"
    r"|LD_LIBRARY_PATH"
)
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
USER = re.compile(r"[A-Za-z_][A-Za-z0-9_.-]*|[0-9]+")
ETC = "/etc/robotd"
WATCHDOG_S = 10
START_TIMEOUT_S = 60  # until the nodes answer; the device may come later
STOP_MARGIN_S = 20.0  # a start-up that is aborted, and the end of nodes and middleware
OPEN_FILES = 4096
_PLAIN = re.compile(r"[\w@+=:,./-]+", re.ASCII)
ROOT = "root"

UNIT = """\
# Written by robotd service install, which replaces this file. Changes belong in
# {etc}/{name}.env, or in a drop-in: systemctl edit {file_name}
[Unit]
Description={description}
Wants=network-online.target
After=network-online.target
StartLimitIntervalSec=120
StartLimitBurst=5

[Service]
Type=notify
NotifyAccess=main
WatchdogSec={watchdog_s}
EnvironmentFile=-{etc}/{name}.env
EnvironmentFile=-{etc}/{name}.d/*.env
Environment=HOME=%S/robotd/{name} XDG_STATE_HOME=%S/robotd/{name} PYTHONUNBUFFERED=1
StateDirectory=robotd/{name}
WorkingDirectory=%S/robotd/{name}
ExecStart={command}
TimeoutStartSec={start_timeout_s}
TimeoutStopSec={stop_timeout_s}
KillMode=mixed
Restart=on-failure
RestartSec=2
# Command line, robot's file, plugin: the next start would fail alike.
RestartPreventExitStatus=2 3 4
LimitRTPRIO={realtime_priority}
LimitNICE={niceness:+d}
LimitMEMLOCK=infinity
LimitNOFILE={open_files}
LimitCORE=0
NoNewPrivileges=yes
ProtectHome={protect_home}
{hardening}
[Install]
WantedBy=multi-user.target
"""

# MemoryDenyWriteExecute is not here: callbacks of the middleware through ctypes need executable
# memory. PrivateTmp leaves /dev/shm, where the middleware's segments are, common to all users.
HARDENING = """\
User={user}
ProtectSystem=strict
PrivateTmp=yes
ProtectClock=yes
ProtectControlGroups=yes
ProtectHostname=yes
ProtectKernelLogs=yes
ProtectKernelModules=yes
ProtectKernelTunables=yes
LockPersonality=yes
RestrictSUIDSGID=yes
RestrictNamespaces=yes
RestrictAddressFamilies=AF_UNIX AF_INET AF_INET6 AF_NETLINK AF_CAN AF_PACKET
SystemCallArchitectures=native
SystemCallFilter=@system-service
SystemCallErrorNumber=EPERM
UMask=0027
CapabilityBoundingSet={capabilities}
AmbientCapabilities={capabilities}
"""


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
    kept = sorted(
        variable for variable in os.environ.items() if KEPT.fullmatch(variable[0]) and variable[1]
    )
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
    from robotd.api.commands import check_backend_overrides, check_namespace, load_robot
    from robotd.api.robots import load_backend

    descriptor = load_robot(robot, variant, overrides)
    chosen = load_backend(backend or descriptor.backend)
    check_backend_overrides(overrides, chosen.name)
    chosen.context(descriptor)
    name = name or descriptor.name
    if not NAME.fullmatch(name):
        raise InvalidArgument(f"--name {name!r}: letters, digits, '.', '_' and '-' only")
    if not USER.fullmatch(user):
        raise InvalidArgument(f"--user {user!r}: a name of letters, digits, '.', '_' and '-'")
    python = Path(sys.executable)
    command = [str(python), "-m", "robotd", "run"]
    command += ["--robot", str(Path(robot).resolve()) if Path(robot).is_file() else robot]
    command += ["--backend", chosen.name]
    command += ["--variant", variant] if variant else []
    command += [word for override in overrides for word in ("--set", override.text)]
    command += ["--set", "engine.enable_at_start=false", "--health", str(health)]
    command += ["--log-format", "json"]
    ros = ["--ros-args", "-r", f"__ns:={check_namespace(namespace)}"] if namespace else []
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


@dataclass(frozen=True)
class ServiceUnit:
    """Values of a unit.

    Attributes:
        name: of the robot's service, without ``robotd-``.
        description: one line.
        command: words that start robotd; those of ``ROBOTD_ARGS`` follow.
        ros_args: from ``--ros-args`` on, the last words.
        user: that it runs as. ``root`` leaves most of the hardening out, which the engine of a
            vendor does not work with.
        realtime_priority, niceness: of the robot's file; the limits allow them and no more.
        shutdown_s: time for an orderly end.
        linux_capabilities: that the backend needs.
        home: the environment of Python is in a home folder, which has to be readable.
    """

    name: str
    description: str
    command: Sequence[str]
    ros_args: Sequence[str]
    user: str
    realtime_priority: int
    niceness: int
    shutdown_s: float
    linux_capabilities: Sequence[str]
    home: bool

    @property
    def file_name(self) -> str:
        """Name of the unit's file."""
        return f"robotd-{self.name}.service"

    @property
    def text(self) -> str:
        """Content of the unit's file."""
        # Unquoted, $ROBOTD_ARGS is split into words.
        words = [*map(quoted, self.command), "$ROBOTD_ARGS", *map(quoted, self.ros_args)]
        capabilities = " ".join(self.linux_capabilities)
        hardening = HARDENING.format(user=self.user, capabilities=capabilities)
        return UNIT.format(
            etc=ETC,
            name=self.name,
            file_name=self.file_name,
            description=self.description.replace("%", "%%"),
            watchdog_s=WATCHDOG_S,
            command=" ".join(words),
            start_timeout_s=START_TIMEOUT_S,
            stop_timeout_s=math.ceil(self.shutdown_s + STOP_MARGIN_S),
            realtime_priority=self.realtime_priority,
            niceness=self.niceness,
            open_files=OPEN_FILES,
            protect_home="read-only" if self.home else "yes",
            hardening="" if self.user == ROOT else hardening,
        )


def environment_text(variables: Sequence[tuple[str, str]]) -> str:
    """Return the content of the environment file: those of this shell that concern ROS."""
    lines = [
        "# Environment of the service. Files of the folder beside it with the same name and .d are",
        "# read after it, in the order of their names. Several words in ROBOTD_ARGS are options of",
        "# robotd run: ROBOTD_ARGS=--set engine.reconnect=true --metrics 9100",
        *(f'{name}="{_in_double_quotes(value)}"' for name, value in variables),
        "#ROBOTD_ARGS=",
    ]
    return "\n".join(lines) + "\n"


def quoted(word: str) -> str:
    """Return ``word`` as systemd reads it back in a command line."""
    word = word.replace("%", "%%").replace("$", "$$")
    if _PLAIN.fullmatch(word):
        return word
    return '"{}"'.format(_in_double_quotes(word).replace("\n", r"\n"))


def is_in_home(path: Path) -> bool:
    """Return True for a path that ``ProtectHome`` hides."""
    return path.is_relative_to("/home") or path.is_relative_to("/root")


def _in_double_quotes(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"')
