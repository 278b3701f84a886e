"""Named inputs and outputs of a running robot."""

from __future__ import annotations

from std_msgs.msg import String
from std_srvs.srv import SetBool

from robotd.errors import InvalidArgument, unknown_name
from robotd.ros.client.ros_client import RosClient
from robotd.ros.node_registry import OPERATOR_NODE
from robotd.ros.qos import LATCHED

IO = f"{OPERATOR_NODE}/io"
LEVELS = {"on": True, "off": False}

Levels = dict[str, bool | None]


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
    return str(client.call(SetBool, f"{OPERATOR_NODE}/outputs/{name}", data=on).message)
