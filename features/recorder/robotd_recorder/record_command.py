"""``robotd record``: record a running robot until Ctrl-C, or repair a recording."""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path

import click

from robotd.api import DeviceTimeout
from robotd.api.commands import FILE, Interrupt, NumberRange
from robotd_ros.commands.robot_client import (
    ROS_EPILOG,
    client_options,
    require_one_robot,
    robot_client,
)
from robotd_ros.node_names import OPERATOR_NODE

RECORD = f"{OPERATOR_NODE}/record"
SAVE_TIMEOUT_S = 30.0
TICK_S = 0.1


@click.command("record", epilog=ROS_EPILOG)
@click.option(
    "--recover",
    metavar="FILE",
    type=FILE,
    help="Repair a recording that was not closed; a copy of FILE stays.",
)
@click.option(
    "--time",
    "time_s",
    metavar="SECONDS",
    type=NumberRange(0.1),
    help="Stop after this time; by default with Ctrl-C.",
)
@client_options
def record(*, recover: Path | None, time_s: float | None, timeout_s: float) -> None:
    """Record the running robot, or repair a recording.

    The robot's own process records everything at full rate, on its computer, in the folder of the
    flight recorder. To record from the start: robotd run --record DIR.
    """
    if recover is None:
        _record(timeout_s, time_s)
    else:
        _recover(recover)


def _recover(path: Path) -> None:
    from robotd_recording.recording_repair import recover

    found = recover(path)
    if found is None:
        click.echo(f"{path}: complete, nothing to repair")
        return
    size = f"{found.messages} messages over {found.duration_s:.1f} s"
    click.echo(f"{path}: {size}; the damaged file is {found.damaged}")


def _record(timeout_s: float, time_s: float | None) -> None:
    """Record until Ctrl-C, the loss of the terminal, or for ``time_s``; print the file."""
    with robot_client(max(timeout_s, SAVE_TIMEOUT_S)) as client:
        name = client.node.resolve_service_name(RECORD)
        client.wait(lambda: client.node.count_services(RECORD), f"service {name}")
        require_one_robot(client)
        with Interrupt() as interrupt:  # also in the calls: what was started is stopped
            started = client.switch(RECORD, True)
            with suppress(OSError):  # of a lost terminal
                click.echo(f"{started}, stop with Ctrl-C", err=True)
            end_s = None if time_s is None else time.monotonic() + time_s
            while not interrupt.happened and (end_s is None or time.monotonic() < end_s):
                # That the robot was killed shows after 20 s.
                if not client.node.count_services(RECORD):
                    raise DeviceTimeout("the robot has gone: the recording ends with it")
                time.sleep(TICK_S)
            stopped = client.switch(RECORD, False)
        click.echo(stopped)
