"""``robotd stop``: stop one robot, or all robots of the ROS domain."""

from __future__ import annotations

import time
from contextlib import suppress
from typing import TYPE_CHECKING

import click

from robotd.cli.exit_codes import ExitCode
from robotd.cli.layout import warn
from robotd.cli.options import log_options, namespace_option
from robotd.cli.preflight import import_ros
from robotd.errors import DeviceTimeout, OperationError
from robotd.number_argument import NumberRange
from robotd_ros.commands.robot_client import ROS_EPILOG, print_addressed_robots, robot_client

if TYPE_CHECKING:  # it needs rclpy
    from robotd_ros.client.fleet import Fleet
    from robotd_ros.client.ros_client import RosClient
    from robotd_ros.client.stop_request import StopRequest

FIRST_REPORT_S, REPORT_INTERVAL_S = 3.0, 2.0  # discovery takes 2 s on a busy computer
HASTENED_S = 0.3  # from the stop to the first line, where the answer has not come by then
SETTLE_S = 2.0  # without a new discovery, while the robots that are known are stopped


@click.command("stop", epilog=ROS_EPILOG)
@click.option("--all", "stops_all", is_flag=True, help="All robots of the ROS domain.")
@click.option(
    "--timeout",
    "timeout_s",
    metavar="SECONDS",
    type=NumberRange(0.1, 3600),
    default=30.0,
    show_default=True,
    help="How long to try.",
)
@namespace_option
@log_options
def stop(timeout_s: float, *, stops_all: bool) -> ExitCode:
    """Stop all motion of the running robot, until a reset.

    Goals, moves, jogs, homing and the base come to rest by their own ramps, goals on their path.
    Motion is rejected until 'robotd reset'. The command tries until the robot confirms that it is
    at rest, and says so while it tries. No safety function.
    """
    with robot_client(timeout_s, searches=stops_all) as client:
        if stops_all:
            return _stop_all(client)
        request = import_ros("robotd_ros.client.stop_request").StopRequest(client)
        progress = _Progress(timeout_s)
        try:
            while not request.is_done:
                client.spin()
                request.advance()
                if request.is_engaged:
                    progress.hasten()
                progress.report(request.progress)
                if progress.is_over:
                    raise DeviceTimeout(_unconfirmed(client, request, timeout_s))
            click.echo(request.result())
            robots = print_addressed_robots(client)
            with suppress(DeviceTimeout):
                client.wait(lambda: request.reaches(robots), "robots of this namespace", SETTLE_S)
        finally:
            request.close()
    return ExitCode.OK


def _stop_all(client: RosClient) -> ExitCode:
    """Stop each robot as soon as it is found, and name it when it confirms, or does not."""
    stop_of_all = import_ros("robotd_ros.client.stop_request").StopOfAll(client)
    fleet: Fleet = import_ros("robotd_ros.client.fleet").Fleet(client)
    make_request = import_ros("robotd_ros.client.stop_request").StopRequest
    requests: dict[str, StopRequest] = {}
    discovery = import_ros("robotd_ros.client.ros_client").Discovery(client.node)
    progress = _Progress(client.timeout_s)
    while not progress.is_over:
        is_engaged = requests and all(request.is_engaged for request in requests.values())
        stop_of_all.send(again=not is_engaged)
        fleet.update()
        for namespace in fleet.namespaces:
            if namespace not in requests:
                requests[namespace] = make_request(client, namespace)
        for namespace, request in requests.items():
            _advance(namespace, request)
        waiting = [name for name, request in requests.items() if not request.is_done]
        is_settled = discovery.quiet_s() > SETTLE_S
        if requests and not waiting and is_settled:
            break
        names = ", ".join(waiting) or "no robot found yet"
        if waiting or is_settled:
            progress.report(names)
    if not requests:
        raise OperationError("no robot runs in this ROS domain: nothing was stopped")
    for namespace, request in sorted(requests.items()):
        if not request.is_done:
            click.echo(f"{namespace}: NOT CONFIRMED: {request.progress}")
        request.close()
    fleet.close()
    stop_of_all.close()
    return ExitCode.OK if all(request.answer for request in requests.values()) else ExitCode.FAILED


def _advance(namespace: str, request: StopRequest) -> None:
    """Advance a request, and name its robot when it has answered."""
    was_done = request.is_done
    request.advance()
    if request.is_done and not was_done:
        click.echo(f"{namespace}: {request.answer or request.failure}")


def _unconfirmed(client: RosClient, request: StopRequest, timeout_s: float) -> str:
    text = f"the stop is not confirmed within {timeout_s:g} s: {request.progress}"
    if request.is_engaged:
        return f"{text}; robotd status shows the axes"
    seen = "robotd is running" if client.runs() else f"no robot found {client.where()}"
    return f"{text}; {seen}; use the emergency stop where motion is dangerous"


class _Progress:
    """Prints on standard error that the command still tries, more rarely while nothing changes."""

    def __init__(self, timeout_s: float) -> None:
        self._began_s = time.monotonic()
        self._timeout_s = timeout_s
        self._due_s = self._began_s + FIRST_REPORT_S
        self._text, self._interval_s = "", REPORT_INTERVAL_S
        self._is_hastened = False

    @property
    def is_over(self) -> bool:
        """The time is over."""
        return time.monotonic() - self._began_s > self._timeout_s

    def hasten(self) -> None:
        """Make the first line due soon: there is something to say."""
        if not self._is_hastened:
            self._is_hastened = True
            self._due_s = min(self._due_s, time.monotonic() + HASTENED_S)

    def report(self, text: str) -> None:
        """Print ``text`` where a line is due."""
        now_s = time.monotonic()
        if now_s >= self._due_s:
            is_same, self._text = text == self._text, text
            self._interval_s = 2.0 * self._interval_s if is_same else REPORT_INTERVAL_S
            self._due_s = now_s + self._interval_s
            with suppress(OSError):  # of a lost terminal, or a pipe that nobody reads
                warn(f"still trying to stop after {now_s - self._began_s:.0f} s: {text}")
