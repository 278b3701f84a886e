"""Text of a systemd unit that serves one robot."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

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
    return word if _PLAIN.fullmatch(word) else f'"{_in_double_quotes(word)}"'


def is_in_home(path: Path) -> bool:
    """Return True for a path that ``ProtectHome`` hides."""
    return path.is_relative_to("/home") or path.is_relative_to("/root")


def _in_double_quotes(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"')
