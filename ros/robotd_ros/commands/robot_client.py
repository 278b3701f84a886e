"""Options and connection of the commands that talk to a running robot."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial, wraps
from typing import TYPE_CHECKING, Any

import click

from robotd.cli.exit_codes import ExitCode, Rejected, RosUnavailable
from robotd.cli.group import STATUS, ros_args
from robotd.cli.options import Command, log_options, namespace_option
from robotd.cli.preflight import import_ros
from robotd.errors import DeviceTimeout, OperationError
from robotd.number_argument import NumberRange

if TYPE_CHECKING:  # it needs rclpy
    from robotd_ros.client.ros_client import RosClient

CLOSE_S = 3  # of node, executor and middleware: a tenth of a second where they do not hang
OWN_NAMESPACES = "start each with a namespace of its own, --ros-args -r __ns:=/NAME"
ROS_EPILOG = "What follows --ros-args goes to ROS; give the same remaps as to the robot."


def client_options(command: Command) -> Command:
    """Add time-out of the robot's answer, namespace, and the options of every command."""
    timeout = click.option(
        "--timeout",
        "timeout_s",
        metavar="SECONDS",
        type=NumberRange(0.1, 600),
        default=5.0,
        envvar="ROBOTD_TIMEOUT",
        show_envvar=True,
        show_default=True,
        help="How long the robot may take to answer.",
    )
    return timeout(namespace_option(log_options(command)))


@contextmanager
def robot_client(timeout_s: float, *, searches: bool = False) -> Iterator[RosClient]:
    """Open a client of the running robot, with the ROS arguments of the command.

    It is closed at the end of the command, when everything is printed: that may hang.

    Raises RosUnavailable without ROS, Rejected with the robot's reason.
    """
    client = import_ros("robotd_ros.client.ros_client").RosClient(
        ros_args(), timeout_s, searches=searches
    )
    try:
        client.start()
    except OperationError as error:
        raise RosUnavailable(str(error)) from error
    context = click.get_current_context().find_root()
    context.call_on_close(partial(_close, client, context))
    try:
        yield client
    except DeviceTimeout as error:
        raise DeviceTimeout(f"{error}{_running_robots(client)}") from error
    except OperationError as error:
        raise Rejected(str(error)) from error


def _close(client: RosClient, context: click.Context) -> None:
    """Close the client; where the middleware hangs, end with the status of the command."""
    middleware = import_ros("robotd_ros.middleware")
    with middleware.exit_where_it_hangs(CLOSE_S, int(context.meta.get(STATUS, ExitCode.OK))):
        client.close()


def _running_robots(client: RosClient) -> str:
    """Return which robots run, and how to choose one; "" where none does."""
    own = client.node.get_namespace()
    found, _ = import_ros("robotd_ros.client.fleet").find_robots(client)
    lines = [
        f"{robot.text} runs here, and does not answer this"
        if robot.namespace == own
        else f"{robot.text} runs: add --ros-args -r __ns:={robot.namespace}"
        for robot in (robot.identity for robot in found)
    ]
    return "".join(f"\n  {line}" for line in lines)


def check_watch(*, as_json: bool) -> None:
    """Raise click.UsageError where a view that changes cannot be shown."""
    if as_json:
        raise click.UsageError("--watch and --json exclude each other")
    if not sys.stdout.isatty():  # there rich prints nothing before the end
        raise click.UsageError("--watch needs a terminal")


def print_addressed_robots(client: RosClient, namespace: str = "") -> int:
    """Print to standard error which robot of a namespace, "" for the client's, is commanded.

    Returns how many robots share it.
    """
    robots = import_ros("robotd_ros.client.fleet").addressed_robots(client, namespace)
    if len(robots) > 1:
        what = f"more than one may get the command; {OWN_NAMESPACES}"
        click.echo(f"{len(robots)} robots share this namespace: {what}", err=True)
    for robot in robots:
        text = robot.text if len(robots) > 1 else robot.identity.text
        click.echo(f"robot: {text}", err=True)
    return len(robots)


def require_one_robot(client: RosClient, namespace: str = "", *, prints: bool = True) -> None:
    """Check that one robot is asked, and print to standard error which; also before reading.

    Where none has announced itself yet, again before the first request of ``client``.

    Raises OperationError for several robots that share the namespace: a command would reach those
    that are discovered by then, one or all, and what is read would be of one or of the other. A
    stop has to reach them all the same.
    """
    if not _require_one(client, namespace, prints=prints):
        client.before_request = partial(_require_one, client, namespace, prints=prints)


def _require_one(client: RosClient, namespace: str, *, prints: bool) -> bool:
    """Require one robot; return False where none has announced itself."""
    robots = import_ros("robotd_ros.client.fleet").addressed_robots(client, namespace)
    if len(robots) > 1:
        names = "".join(f"\n  {robot.text}" for robot in robots)
        what = f"{len(robots)} robots share this namespace, none gets the command: {OWN_NAMESPACES}"
        raise OperationError(f"{what}; robotd stop stops all of them{names}")
    for robot in robots if prints else ():
        click.echo(f"robot: {robot.identity.text}", err=True)
    return bool(robots)


def asks_robot(ask: Command) -> Command:
    """Make a command of a function that asks the running robot.

    The function gets a client of the robot besides its arguments, and the command has the options
    of ``client_options``. What the function returns is printed, unless it is None; an ``ExitCode``
    is the exit status. The command names the robot that it asks, and asks no one of several that
    share a namespace.
    """

    @client_options
    @wraps(ask)
    def command(timeout_s: float, **arguments: Any) -> ExitCode:
        with robot_client(timeout_s) as client:
            require_one_robot(client)
            answer = ask(client, **arguments)
            if answer is not None and not isinstance(answer, ExitCode):
                click.echo(answer)
        return answer if isinstance(answer, ExitCode) else ExitCode.OK

    return command
