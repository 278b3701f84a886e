"""``robotd health``: the health of a running robot, for probes."""

from __future__ import annotations

import json
from http.client import HTTPConnection, HTTPException
from typing import Any

import click

from robotd.api import DeviceTimeout
from robotd.api.commands import ExitCode, IntegerRange, NumberRange, as_json, field, log_options

HEALTH_PORT = 8090  # of `robotd service install`
ADDRESS = "127.0.0.1"


@click.command("health")
@click.option(
    "--port",
    metavar="PORT",
    type=IntegerRange(1, 65535),
    default=HEALTH_PORT,
    show_default=True,
    help="That of 'robotd run --health PORT'.",
)
@click.option(
    "--ready", "asks_ready", is_flag=True, help="Fail, too, while something forbids motion."
)
@click.option(
    "--timeout",
    "timeout_s",
    metavar="SECONDS",
    type=NumberRange(0.1, 600),
    default=3.0,
    show_default=True,
    help="How long the robot may take to answer.",
)
@as_json
@log_options
def health(port: int, timeout_s: float, *, asks_ready: bool, as_json: bool) -> ExitCode:
    """Ask a robot of this computer for its health.

    The status is 0 while its control loop runs, 1 when it hangs, 5 when nothing answers. Needs no
    ROS and takes a quarter of a second: for probes of containers and scripts.
    """
    found = ask_health(port, timeout_s)
    if as_json:
        click.echo(json.dumps(found, indent=2))
    else:
        simulated = ", SIMULATED" if found["simulated"] else ""
        click.echo(f"{found['robot']} on {found['backend']}{simulated}: {found['state']}")
        for problem in found["problems"][1:]:
            click.echo(field("", problem))
    is_good = found["ready"] if asks_ready else found["alive"]
    return ExitCode.OK if is_good else ExitCode.FAILED


def ask_health(port: int, timeout_s: float) -> dict[str, Any]:
    """Return the document of ``/healthz``. Raises DeviceTimeout: nothing answers, or no robot."""
    connection = HTTPConnection(ADDRESS, port, timeout=timeout_s)
    try:
        connection.request("GET", "/healthz")
        found = json.loads(connection.getresponse().read())
        if not isinstance(found, dict) or "alive" not in found:
            raise ValueError("this is not a robot's health")  # noqa: TRY301 - as what is not JSON
    except (OSError, HTTPException, ValueError) as error:
        advice = f"is a robot running here with --health {port}?"
        raise DeviceTimeout(f"no health at http://{ADDRESS}:{port}: {error}; {advice}") from error
    finally:
        connection.close()
    return found
