"""Identities of the running robots: name, namespace, backend and computer of each."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import partial

from std_msgs.msg import String

from robotd.errors import DeviceTimeout
from robotd_ros.client.ros_client import RosClient
from robotd_ros.node_registry import IDENTITY
from robotd_ros.qos import LATCHED

ANSWER_S = 1.0  # for the identity of a robot that answers


@dataclass(frozen=True)
class RobotIdentity:
    """Identity of a running robot.

    Attributes:
        robot: name in its descriptor.
        namespace: of its nodes; "/" for none.
        backend: that it runs on.
        variant: of its descriptor; "" without one.
        computer: host name.
        simulated: nothing real moves.
        version: of robotd.
    """

    robot: str
    namespace: str
    backend: str
    variant: str
    computer: str
    simulated: bool
    version: str

    @property
    def text(self) -> str:
        """The identity for people, in one line."""
        place = "" if self.namespace == "/" else f" in {self.namespace}"
        simulated = ", SIMULATED" if self.simulated else ""
        return f"{self.robot}{place}, backend {self.backend}, on {self.computer}{simulated}"


def read_identity(text: str) -> RobotIdentity:
    """Return the identity of a message of ``IDENTITY``; what it does not tell is "?"."""
    given = json.loads(text)
    words = ("robot", "namespace", "backend", "variant", "computer", "version")
    values = {name: str(given.get(name, "?")) for name in words}
    return RobotIdentity(**values, simulated=bool(given.get("simulated")))


def addressed_robots(client: RosClient) -> tuple[RobotIdentity, ...]:
    """Return the robots that the client's commands reach.

    Several that share a namespace all execute a command. Empty where none tells its identity.
    """
    node, found = client.node, list[str]()
    made = node.create_subscription(String, IDENTITY, partial(_keep, found), LATCHED)
    try:
        client.wait(
            lambda: len(found) >= max(1, node.count_publishers(IDENTITY)), IDENTITY, ANSWER_S
        )
    except DeviceTimeout:
        pass
    finally:
        node.destroy_subscription(made)
    return tuple(map(read_identity, found))


def _keep(found: list[str], message: String) -> None:
    found.append(message.data)
