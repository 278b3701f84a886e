"""``robotd page``: serve the live pages of all robots of the ROS domain."""

from __future__ import annotations

import os

import click

from robotd.api import OperationError
from robotd.api.commands import PORT, Interrupt, import_ros, log_options
from robotd_page.feature import DEFAULT_PORT
from robotd_ros.commands.robot_client import ROS_EPILOG, robot_client

TIMEOUT_S = 5.0


@click.command("page", epilog=ROS_EPILOG)
@click.argument("port", type=PORT, default=DEFAULT_PORT)
@log_options
def page(*, port: int) -> None:
    """Serve the live pages of all robots of the ROS domain.

    At http://127.0.0.1:PORT until Ctrl-C; by default 8080, 0 takes any free port. Read-only. Robots
    may run on this or on other computers, with their recorder switched on, and may come and go.
    """
    try:
        from robotd_page.page_server import PageServer
    except ImportError as error:
        raise OperationError("the page needs aiohttp: pip install 'robotd[page]'") from error
    with robot_client(TIMEOUT_S, searches=True) as client:
        robots = import_ros("robotd_page.remote_robots").RemoteRobots(client)
        with Interrupt() as interrupt, PageServer(robots, port) as server:
            domain = os.environ.get("ROS_DOMAIN_ID") or "0"
            click.echo(f"robots of ROS domain {domain}: {server.url}, stop with Ctrl-C")
            while not interrupt.happened:
                robots.update()
                client.spin()
        robots.close()
