"""Operator commands for a running robot that take more than a call: recovery and outputs."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack

from std_msgs.msg import String
from std_srvs.srv import Trigger

from robotd.control.problem import ProblemKind
from robotd.errors import DeviceTimeout, InvalidArgument, OperationError, unknown_name
from robotd_ros.client.problem_client import ProblemListener, with_remedy
from robotd_ros.client.ros_client import RosClient
from robotd_ros.node_registry import OPERATOR_NODE
from robotd_ros.qos import LATCHED

IO = f"{OPERATOR_NODE}/io"
SPEED = f"{OPERATOR_NODE}/speed"
LEVELS = {"on": True, "off": False}

Levels = dict[str, bool | None]


def recover(client: RosClient, on_step: Callable[[str], None]) -> bool:
    """Recover the robot; ``on_step`` is called with each step as it is reported.

    Returns False while a stop, or a lifecycle manager, forbids motion after the recovery: the last
    step names what allows it.

    Raises:
        DeviceTimeout: no robot answers, or it has gone in between.
        OperationError: the reason of the step that failed.
    """
    service = client.node.create_client(Trigger, f"{OPERATOR_NODE}/recover")
    with (
        ExitStack() as stack,
        client.listen(String, f"{OPERATOR_NODE}/recovery", LATCHED) as report,
    ):
        problems = ProblemListener(client, stack)
        client.wait(service.service_is_ready, f"service {service.service_name}")
        before = report.wait()  # the report of the last recovery, empty before the first
        answer = service.call_async(Trigger.Request())
        printed: list[str] = []
        seen_s = time.monotonic()
        while not answer.done():
            client.spin()
            if report.newest is not before:
                _print_new(report.newest.data, printed, on_step)
            if service.service_is_ready():
                seen_s = time.monotonic()
            elif time.monotonic() - seen_s > client.timeout_s:
                raise DeviceTimeout("the robot has gone during the recovery")
        response = answer.result()
        if not response.success:
            raise OperationError(response.message)
        _print_new(response.message, printed, on_step)
        problems.wait()
        if paused := problems.first(ProblemKind.PAUSED):
            on_step(with_remedy(paused))
        return problems.first(ProblemKind.STOPPED) is None


def _print_new(text: str, printed: list[str], on_step: Callable[[str], None]) -> None:
    """Call ``on_step`` for the lines of ``text`` beyond those in ``printed``."""
    for line in text.splitlines()[len(printed) :]:
        if not line.startswith("failed; "):  # the response has it too
            on_step(line)
        printed.append(line)


def read_levels(text: str) -> tuple[Levels, Levels]:
    """Return inputs and outputs by name, of a message of the topic; None: unknown."""
    inputs: Levels = {}
    outputs: Levels = {}
    for line in text.splitlines():
        kind, _, rest = line.partition(" ")
        name, _, level = rest.partition(": ")
        (inputs if kind == "input" else outputs)[name] = LEVELS.get(level)
    return inputs, outputs


def set_output(client: RosClient, name: str, on: bool) -> str:
    """Set a named output; return the robot's answer.

    Raises:
        InvalidArgument: the robot has no such name.
        DeviceTimeout: no robot answers in time.
        OperationError: the robot's reason for a rejection.
    """
    with client.listen(String, IO, LATCHED) as levels:
        _, outputs = read_levels(levels.wait().data)
    if name not in outputs:
        raise InvalidArgument(unknown_name("output", name, outputs))
    return client.switch(f"{OPERATOR_NODE}/outputs/{name}", on)
