"""Robots of the ROS domain: identity and state of each, as they announce them."""

from __future__ import annotations

import json
import posixpath
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from std_msgs.msg import String

from robotd.errors import DeviceTimeout
from robotd.log import printable
from robotd_ros.client.ros_client import RosClient
from robotd_ros.node_names import SUMMARY
from robotd_ros.qos import LATCHED

SEARCH_PERIOD_S = 0.2
SILENCE_S = 3.5  # a robot announces itself every second
SILENT = "no answer"
ANSWER_S = 1.0  # for the summary of a robot that answers
OTHERS_S = 3.0  # for those that it knows; one that was killed counts for 20 s, and never answers


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
    """Return the identity in a message of ``IDENTITY``; a missing value is "?"."""
    try:
        given = dict(json.loads(text))
    except (ValueError, TypeError):  # of another program
        given = {}
    words = ("robot", "namespace", "backend", "variant", "computer", "version")
    values = {name: printable(str(given.get(name, "?"))) for name in words}
    return RobotIdentity(**values, simulated=bool(given.get("simulated")))


@dataclass(frozen=True)
class Neighbour:
    """One robot of a namespace.

    Attributes:
        identity: which robot it is.
        pid: of its process, on its computer; 0: not known.
        sharing: other robots that it sees in its namespace; one that was killed counts for a while.
    """

    identity: RobotIdentity
    pid: int
    sharing: int

    @property
    def text(self) -> str:
        """The identity for people, with the process."""
        return f"{self.identity.text}, process {self.pid}"


def read_neighbour(text: str) -> Neighbour:
    """Return the robot in a message of ``SUMMARY``; a missing value is "?" or 0."""
    numbers = {"pid": 0, "sharing": 0}
    try:
        given = dict(json.loads(text))
        numbers = {name: int(given.get(name, 0)) for name in numbers}
    except (ValueError, TypeError):  # of another program
        pass
    return Neighbour(read_identity(text), **numbers)


def addressed_robots(client: RosClient, namespace: str = "") -> tuple[Neighbour, ...]:
    """Return the robots that the commands of a namespace reach; "" for the client's own.

    Several that share a namespace may all execute a command. The first that answers says how many
    others it knows, so that one is awaited only where there may be another one. Empty where none
    has been discovered that publishes its summary.
    """
    node, found = client.node, dict[object, Neighbour]()
    topic = posixpath.join(namespace, SUMMARY)

    def keep(message: String) -> None:
        robot = read_neighbour(message.data)
        found[robot.identity.computer, robot.pid] = robot

    def is_complete() -> bool:
        return bool(found) and len(found) >= expected()

    def expected() -> int:
        return max([node.count_publishers(topic), *(1 + robot.sharing for robot in found.values())])

    made = node.create_subscription(String, topic, keep, LATCHED)
    try:
        with suppress(DeviceTimeout):
            client.wait(is_complete, topic, ANSWER_S)
        if expected() > len(found):
            with suppress(DeviceTimeout):
                client.wait(is_complete, topic, OTHERS_S)
    finally:
        node.destroy_subscription(made)
    return tuple(found.values())


@dataclass(frozen=True)
class FleetRobot:
    """One robot of a list.

    Attributes:
        identity: which robot it is.
        pid: of its process, on its computer.
        state: "ready", what it is instead, or "no answer" after ``SILENCE_S`` without a message.
        problems: texts, the root cause first.
        owners: clients that move axes.
        uptime_s: since its nodes were made.
    """

    identity: RobotIdentity
    pid: int
    state: str
    problems: tuple[str, ...]
    owners: tuple[str, ...]
    uptime_s: float

    @property
    def json(self) -> dict[str, Any]:
        """Values of all attributes, those of the identity among them."""
        own = {name: value for name, value in vars(self).items() if name != "identity"}
        return {**vars(self.identity), **own}


class Fleet:
    """Subscriptions of all summaries. One thread, the client's.

    Args:
        client: started, with ``searches``; its own namespace does not matter.
    """

    def __init__(self, client: RosClient) -> None:
        self._client = client
        self._subscriptions: dict[str, Any] = {}  # by topic
        self._robots: dict[tuple[str, str, int], tuple[str, FleetRobot, float]] = {}
        self._search_s = 0.0

    def update(self) -> None:
        """Handle the next event, and look for robots that have come or gone."""
        self._client.spin()
        if time.monotonic() < self._search_s:
            return
        self._search_s = time.monotonic() + SEARCH_PERIOD_S
        node = self._client.node
        for topic, _ in node.get_topic_names_and_types():
            if topic.endswith(f"/{SUMMARY}") and topic not in self._subscriptions:
                keep = partial(self._keep, topic)
                made = node.create_subscription(String, topic, keep, LATCHED)
                self._subscriptions[topic] = made
        seen = [topic for topic, _, _ in self._robots.values()]
        for key, (topic, _, seen_s) in list(self._robots.items()):
            running = node.count_publishers(topic)
            # One that was killed may have been started again meanwhile.
            is_silent = time.monotonic() - seen_s > SILENCE_S
            if not running or (is_silent and running < seen.count(topic)):
                del self._robots[key]

    @property
    def namespaces(self) -> list[str]:
        """Namespaces of the robots that are discovered; they may not have announced themselves."""
        count = self._client.node.count_publishers
        topics = [topic for topic in self._subscriptions if count(topic)]
        return [topic.removesuffix(f"/{SUMMARY}") or "/" for topic in topics]

    @property
    def is_complete(self) -> bool:
        """Every robot that is discovered has announced itself."""
        seen = [topic for topic, _, _ in self._robots.values()]
        count = self._client.node.count_publishers
        return all(seen.count(topic) >= count(topic) for topic in self._subscriptions)

    @property
    def robots(self) -> tuple[FleetRobot, ...]:
        """Return those that are known, by namespace, name and process."""
        now_s = time.monotonic()
        found = [
            robot if now_s - seen_s < SILENCE_S else replace(robot, state=SILENT)
            for _, robot, seen_s in self._robots.values()
        ]
        return tuple(
            sorted(
                found, key=lambda robot: (robot.identity.namespace, robot.identity.robot, robot.pid)
            )
        )

    def close(self) -> None:
        """End the subscriptions."""
        for subscription in self._subscriptions.values():
            self._client.node.destroy_subscription(subscription)

    def _keep(self, topic: str, message: String) -> None:
        robot = read_summary(message.data)
        if robot is not None:
            key = (topic, robot.identity.computer, robot.pid)
            self._robots[key] = (topic, robot, time.monotonic())


def read_summary(text: str) -> FleetRobot | None:
    """Return the robot of a message of ``SUMMARY``; None for what is not readable."""
    try:
        given = json.loads(text)
        return FleetRobot(
            read_identity(text),
            int(given["pid"]),
            printable(str(given["state"])),
            tuple(printable(str(problem)) for problem in given["problems"]),
            tuple(printable(str(owner)) for owner in given["owners"]),
            float(given["uptime_s"]),
        )
    except (ValueError, KeyError, TypeError):
        return None


def find_robots(client: RosClient, settle_s: float = 0.0) -> tuple[tuple[FleetRobot, ...], bool]:
    """Return all robots of the ROS domain, by namespace and name, and whether that is sure.

    It is not where the client's time-out ends before discovery, or before a robot has answered.

    Args:
        client: its own namespace does not matter.
        settle_s: where the client is new: discovery has ended when it finds nothing new for so
            long; the time-out where nothing is found by then.
    """
    fleet = Fleet(client)
    deadline_s = time.monotonic() + client.timeout_s
    try:
        is_settled = client.settle(settle_s, fleet.update)
        while time.monotonic() < deadline_s:
            fleet.update()
            if fleet.is_complete and (fleet.robots or not settle_s):
                break
        return fleet.robots, is_settled and fleet.is_complete
    finally:
        fleet.close()
