"""The page of the ROS surface lists what the nodes have, and they have what it lists."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest

with warnings.catch_warnings():  # rosidl imports an old lark
    warnings.simplefilter("ignore", DeprecationWarning)
    import rosidl_generator_py  # noqa: F401

from rclpy.node import Node

from robotd.robot import build_robot
from robotd.ros.endpoints import report_of
from robotd.ros.host import RosHost
from robotd.ros.registry import make_node

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "ros-surface.md"
ROBOTS = (("cr3a", "intel"), ("cr3a", "orin"), ("baymax", None))
TOPIC_PARAMETERS = {
    "encoder_joint_topic",
    "cmd_vel_topic",
    "encoder_vel_topic",
    "encoder_omega_topic",
    "encoder_odometry_topic",
}


def rows(kind: str, nodes: list[Node]) -> dict[str, str]:
    """First column → second, of the tables of ``kind`` in the sections of ``nodes``."""
    found: dict[str, str] = {}
    names = {node.get_name() for node in nodes}
    section, table = "", ""
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip().strip("`") for cell in line.strip("|").split("|")]
        if line.startswith("## "):
            section = line.removeprefix("## ")
        if not line.startswith("|"):
            table = ""
        elif not table:
            table = cells[0]
        elif section in names and table.startswith(kind) and not set(cells[0]) <= {"-"}:
            found[cells[0]] = cells[1]
    return found


@pytest.fixture(scope="module", params=ROBOTS)
def nodes(request: pytest.FixtureRequest) -> Iterator[list[Node]]:
    """The nodes of a robot, made but not started."""
    name, variant = request.param
    robot = build_robot(name, "sim", variant)
    with pytest.MonkeyPatch.context() as patch, RosHost(domain_id=99) as host:
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
        made = []
        for name in robot.descriptor.nodes:
            made.append(make_node(name, robot, host))
            host.add_node(made[-1])
        yield made


def values(nodes: list[Node], names: set[str]) -> dict[str, str]:
    """Resolved value → name of the parameters in ``names``, those that are not empty."""
    return {
        node.resolve_topic_name(str(node.get_parameter(name).value)): name
        for node in nodes
        for name in names
        if node.has_parameter(name) and node.get_parameter(name).value
    }


def listed(names: set[str], parameters: dict[str, str]) -> set[str]:
    """Resolved names as the page writes them: relative, or by parameter."""
    return {parameters.get(name, name.removeprefix("/")) for name in names}


def test_services(nodes: list[Node]) -> None:
    by_parameter = values(nodes, {"wmx_gripper_topic"})
    assert listed(set(report_of(nodes).services), by_parameter) == set(rows("service", nodes))


def test_topics_and_their_types(nodes: list[Node]) -> None:
    page = rows("published topic", nodes) | rows("subscribed topic", nodes)
    optional = {"isaacsim_joint_topic", "gazebo_joint_topic", "tf"}
    by_parameter = values(nodes, optional | TOPIC_PARAMETERS)
    topics = {listed({t.name}, by_parameter).pop(): t.type for t in report_of(nodes).topics}
    assert topics.items() <= page.items()
    assert set(page) - set(topics) <= optional


def test_action(nodes: list[Node]) -> None:
    by_parameter = values(nodes, {"joint_trajectory_action"})
    assert listed(set(report_of(nodes).actions), by_parameter) == set(rows("action", nodes))


def test_parameters_and_their_types(nodes: list[Node]) -> None:
    common = {"use_sim_time", "start_type_description_service"}
    page = {
        name: kind.upper().replace("BOOLEAN", "BOOL").replace(" ", "_")
        for name, kind in rows("parameter", nodes).items()
    }
    declared = {
        name: parameter.type_.name
        for node in nodes
        for name, parameter in node.get_parameters_by_prefix("").items()
        if name not in common and not name.startswith("qos_overrides")
    }
    assert declared == page


def test_every_node_has_a_section(nodes: list[Node]) -> None:
    sections = re.findall(r"^## (.*)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert {node.get_name() for node in nodes} <= set(sections)
