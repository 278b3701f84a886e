"""Print what the nodes of all robots offer, as JSON. A process of its own: rclpy stays in it.

The nodes run, on the simulation; the devices are not opened. What a node offers is taken from its
own publishers, subscriptions and services, so nothing depends on discovery.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from rclpy.action import get_action_server_names_and_types_by_node
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from robotd.clock.simulated import PacedClock
from robotd.descriptor import load_robot_descriptor
from robotd.plugin.manager import load_backend
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.run_nodes import report_of, run_nodes
from robotd_scenario import FaultSchedule
from robotd_testing.domain import own_domain

ROBOTS = (
    ("cr3a", "intel", ()),
    ("cr3a", "orin", ()),
    ("baymax", None, ()),
    ("baymax", None, ("-p", "publish_tf:=true", "-p", "publish_limited_velocity:=true")),
    ("skid_steer_base", None, ()),
    ("mecanum_base", None, ()),
    ("mecanum_base", None, ("-p", "publish_limited_velocity:=true")),
    ("tricycle_base", None, ()),
    ("tricycle_base", None, ("-p", "publish_limited_velocity:=true")),
)
COMMON = {"use_sim_time", "start_type_description_service"}  # every node of ROS has them
COMMON_TOPICS = {"/rosout", "/parameter_events", "/diagnostics"}
TYPES = {"BOOL": "boolean", "DOUBLE": "number", "STRING": "text", "INTEGER": "integer"}
LONGEST = 90  # characters of a value that are shown


@contextmanager
def running(robot: str, variant: str | None, ros_args: tuple[str, ...]) -> Iterator[list[Node]]:
    """Run all nodes of a robot, the one of the simulation too."""
    descriptor = load_robot_descriptor(robot, variant)
    made = Robot(descriptor, load_backend("sim"), PacedClock(1.0))
    arguments = ["--ros-args", *ros_args] if ros_args else []
    with own_domain() as domain, RosHost(arguments, domain_id=domain) as host:
        faults = FaultSchedule(made, ())
        with run_nodes(made, descriptor.nodes, host, parts={"scenario": faults}) as nodes:
            yield nodes


def describe(node: Node) -> dict[str, Any]:
    """Return services, topics, actions and parameters of one node."""
    report = report_of([node])
    by_value = {
        node.resolve_topic_name(str(value.value)): name
        for name, value in node.get_parameters_by_prefix("").items()
        if name.endswith(("_topic", "_action", "_service")) and value.value
    }
    types = dict(node.get_service_names_and_types())
    own = (node.get_name(), node.get_namespace())
    kinds = {
        name: types[0] for name, types in get_action_server_names_and_types_by_node(node, *own)
    }
    topics = {topic.name: topic.type for topic in report.topics}

    def entity(name: str, kind: str, qos: str = "") -> dict[str, Any]:
        return {"name": name, "parameter": by_value.get(name), "type": kind, "qos": qos}

    def endpoints(which: Any) -> list[dict[str, Any]]:
        found = {end.topic_name: qos_words(end.qos_profile) for end in which}
        return [
            entity(name, topics.get(name, "rosgraph_msgs/msg/Clock"), found[name])
            for name in sorted(found)
            if name not in COMMON_TOPICS
        ]

    return {
        "services": [entity(name, types[name][0]) for name in report.services],
        "published": endpoints(node.publishers),
        "subscribed": endpoints(node.subscriptions),
        "actions": [entity(name, kinds[name]) for name in report.actions],
        "parameters": list(parameters(node)),
    }


def parameters(node: Node) -> Iterator[dict[str, Any]]:
    """Yield name, type, value and description of the parameters that the node declares."""
    for name, value in node.get_parameters_by_prefix("").items():
        if name in COMMON or name.startswith("qos_overrides"):
            continue
        kind, _, is_array = value.type_.name.partition("_")
        word = TYPES[kind]
        shown = ", ".join(map(str, value.value)) if is_array else str(value.value)
        if len(shown) > LONGEST or "\n" in shown:
            shown = "..."
        description = node.describe_parameter(name).description
        yield {
            "name": name,
            "type": f"list of {word}" if is_array else word,
            "value": shown if shown or kind != "STRING" else '""',
            "description": description,
        }


def qos_words(profile: Any) -> str:
    """Return a QoS profile in words."""
    words = ["reliable" if profile.reliability == ReliabilityPolicy.RELIABLE else "best effort"]
    if profile.durability == DurabilityPolicy.TRANSIENT_LOCAL:
        words.append("transient local")
    return f"{', '.join(words)}, depth {profile.depth}"


def merge(into: dict[str, Any], node: dict[str, Any], robot: str) -> None:
    """Add what a node offers with one robot to what it offers with the others."""
    for kind in ("services", "published", "subscribed", "actions"):
        known = {item["name"] for item in into[kind]}
        into[kind] += [item for item in node[kind] if item["name"] not in known]
    known = {item["name"]: item for item in into["parameters"]}
    for parameter in node["parameters"]:
        values = known[parameter["name"]]["values"] if parameter["name"] in known else {}
        values.setdefault(parameter.pop("value"), []).append(robot)
        if parameter["name"] not in known:
            into["parameters"].append(parameter | {"values": values})


def main() -> None:
    """Ask all robots, one after the other."""
    surface: dict[str, Any] = {}
    for robot, variant, ros_args in ROBOTS:
        with running(robot, variant, ros_args) as nodes:
            for node in nodes:
                empty = {
                    kind: []
                    for kind in ("services", "published", "subscribed", "actions", "parameters")
                }
                into = surface.setdefault(node.get_name(), empty)
                found = describe(node)
                if ros_args:  # values that nobody else has
                    found["parameters"] = []
                merge(into, found, f"{robot} {variant}" if variant else robot)
    for node in surface.values():
        for parameter in node["parameters"]:
            values = parameter["values"].items()
            parameter["values"] = [
                (value, "" if len(values) == 1 else ", ".join(robots)) for value, robots in values
            ]
    json.dump(surface, sys.stdout, indent=1)


if __name__ == "__main__":
    main()
