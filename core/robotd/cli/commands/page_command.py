"""``robotd page``: serve the live pages of all robots of the ROS domain."""

from __future__ import annotations

import os
from collections.abc import Sequence

import click

from robotd.cli.exit_codes import ExitCode
from robotd.cli.group import ros_args
from robotd.cli.interrupt import Interrupt
from robotd.cli.options import PORT, configure_logging, log_options
from robotd.cli.preflight import import_ros
from robotd.cli.robot_client import robot_client
from robotd.errors import OperationError

DEFAULT_PORT = 8080
TIMEOUT_S = 5.0


@click.command("page")
@click.argument("port", type=PORT, default=DEFAULT_PORT)
@log_options
@click.pass_context
def page(ctx: click.Context, /, *, port: int) -> None:
    """Serve the live pages of all robots of the ROS domain.

    At http://127.0.0.1:PORT until Ctrl-C; by default 8080, 0 takes any free port. Read-only. Robots
    may run on this or on other computers, with their recorder switched on, and may come and go.
    """
    configure_logging(ctx)
    ctx.exit(_serve(ros_args(ctx), port))


def _serve(ros_args: Sequence[str], port: int) -> ExitCode:
    try:
        from robotd.page.page_server import PageServer
    except ImportError as error:
        raise OperationError("the page needs aiohttp: pip install 'robotd[page]'") from error
    with robot_client(ros_args, TIMEOUT_S, searches=True) as client:
        robots = import_ros("client.remote_robots").RemoteRobots(client)
        with Interrupt() as interrupt, PageServer(robots, port) as server:
            domain = os.environ.get("ROS_DOMAIN_ID") or "0"
            click.echo(f"robots of ROS domain {domain}: {server.url}, stop with Ctrl-C")
            while not interrupt.happened:
                robots.update()
                client.spin()
        robots.close()
    return ExitCode.OK
