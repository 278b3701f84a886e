"""Two arms and a base in one ROS domain: no common names, no mutual effect."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from itertools import combinations
from typing import Any

import pytest
from control_msgs.action import FollowJointTrajectory
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import SetBool
from tests.ros.robot_process import ACTION, LATCHED, Client, RobotProcess, command_until, wait_until
from trajectory_msgs.msg import JointTrajectoryPoint

from robotd_testing.domain import own_domain

pytestmark = pytest.mark.ros

ARM = {"joint_states", "wmx/axis/state", "wmx/set_gripper", "wmx/io/get_input_bit",
       f"{ACTION[1:]}/_action/status", f"{ACTION[1:]}/_action/send_goal"}  # fmt: skip
EXPECTED = {
    "/left": {f"/left/{name}" for name in ARM},
    "/right": {f"/right/{name}" for name in ARM},
    "/": {"/odom_enc", "/cmd_vel", "/wmx/axis/state", "/wmx/io/get_input_bit"},
}
# By all of ROS, and by all robots.
SHARED = {"/rosout", "/parameter_events", "/diagnostics", "/tf_static", "/robotd/stop_all"}


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    """A client in the domain of all three."""
    with ExitStack() as stack:
        domain = stack.enter_context(own_domain())
        processes = [
            RobotProcess(*arguments, domain=domain, robot=robot)
            for robot, arguments in (
                ("cr3a", ("--ros-args", "-r", "__ns:=/left")),
                ("cr3a", ("--ros-args", "-r", "__ns:=/right")),
                ("baymax", ()),
            )
        ]
        for process in processes:
            stack.enter_context(process)
        for process in processes:
            process.wait_ready()
        client = Client(domain)
        stack.callback(client.close)
        yield client


def nodes_in(node: Node, namespace: str) -> list[str]:
    found = node.get_node_names_and_namespaces()
    return [name for name, space in found if space == namespace and name != node.get_name()]


def names_in(node: Node, namespace: str) -> set[str]:
    """Every topic and service of the nodes in ``namespace``; an action is some of each."""
    return {
        name
        for own in nodes_in(node, namespace)
        for listing in (
            node.get_publisher_names_and_types_by_node(own, namespace),
            node.get_subscriber_names_and_types_by_node(own, namespace),
            node.get_service_names_and_types_by_node(own, namespace),
        )
        for name, _ in listing
    }


def first_joint(state: Any) -> float:
    return float(state.position[0])


def run(client: Client, *arguments: str) -> int:
    """Exit status of a command for people, in the domain of the robots."""
    environment = os.environ | {"ROS_DOMAIN_ID": str(client.domain)}
    return subprocess.run(
        [sys.executable, "-m", "robotd", *arguments], env=environment, timeout=90, check=False
    ).returncode


def test_no_name_is_in_common(client: Client) -> None:
    node = client.node
    for space, expected in EXPECTED.items():
        wait_until(lambda s=space, e=expected: e <= names_in(node, s), f"the names in {space}")
    names = {space: names_in(node, space) - SHARED for space in EXPECTED}
    for one, other in combinations(EXPECTED, 2):
        assert names[one] & names[other] == set()
    for space in ("/left", "/right"):
        assert {name for name in names[space] if not name.startswith(f"{space}/")} == set()


def test_the_diagnostics_tell_the_robots_apart(client: Client) -> None:
    messages = client.listen(DiagnosticArray, "/diagnostics")
    robots = {"left/cr3a", "right/cr3a", "baymax"}
    wait_until(lambda: {m.status[0].hardware_id for m in messages} == robots, "all three")


def test_a_command_reaches_its_own_robot_only(client: Client) -> None:
    left = client.listen(JointState, "/left/joint_states")
    right = client.listen(JointState, "/right/joint_states")
    base = client.listen(Odometry, "/odom_enc")
    for messages in (left, right, base):
        client.next(messages)
    goal = FollowJointTrajectory.Goal()
    goal.trajectory.joint_names = [f"joint{number}" for number in range(1, 7)]
    point = JointTrajectoryPoint(positions=[0.2] * 6)
    point.time_from_start.nanosec = 500_000_000
    goal.trajectory.points = [point]
    _, result = client.send_goal(goal, action=f"/left{ACTION}").result()
    assert result.error_code == FollowJointTrajectory.Result.SUCCESSFUL, result.error_string
    assert client.call(SetBool, "/right/wmx/set_gripper", data=True).success
    wait_until(lambda: first_joint(left[-1]) == pytest.approx(0.2, abs=1e-3), "the left arm")
    wait_until(lambda: right[-1].position[6] == 0.045, "the right gripper")
    assert abs(first_joint(client.next(right))) < 1e-3
    assert client.next(left).position[6] == 0.0
    assert client.next(base).pose.pose.position.x == 0.0

    twist = Twist()
    twist.linear.x = 0.3
    commands = client.publisher(Twist, "/cmd_vel")

    command_until(
        lambda: commands.publish(twist),
        lambda: base[-1].pose.pose.position.x > 0.01,
        "the base moves",
    )
    assert first_joint(client.next(left)) == pytest.approx(0.2, abs=1e-3)


def test_the_commands_reach_the_robot_of_their_namespace(client: Client) -> None:
    right = client.listen(JointState, "/right/joint_states")
    assert run(client, "gripper", "open", "--ros-args", "-r", "__ns:=/right") == 0
    assert run(client, "move", "joint1=0.1", "--ros-args", "-r", "__ns:=/right") == 0
    state = client.next(right)
    assert first_joint(state) == pytest.approx(0.1, abs=2e-3)
    assert state.position[6] == 0.0


def test_the_end_of_one_leaves_the_others_ready(client: Client) -> None:
    ready = client.listen(Bool, "/right/wmx/engine/ready", LATCHED)
    assert client.call(SetBool, "/left/wmx/engine/set_comm", data=False).success
    client.wait_engine(ready=False, topic="/left/wmx/engine/ready")
    client.next(ready)
    assert all(message.data for message in ready)


def test_two_robots_of_one_name_are_warned_of() -> None:
    nodes = ("--nodes", "wmx_engine_node")
    with RobotProcess(*nodes) as first:
        first.wait_ready()
        with RobotProcess(*nodes, domain=first.domain) as second:
            for robot, other in ((first, second), (second, first)):
                robot.wait_output("another process serves nodes of the same names")
                assert f"process {other.process.pid}: " in robot.output
                # One of its nodes: they are discovered one after the other.
                assert re.search(r"nodes=\['/(robotd|wmx_engine_node)'", robot.output)
            client = Client(first.domain)
            messages = client.listen(DiagnosticArray, "/diagnostics")
            names = "robotd/cr3a: names"
            warned = client.next(
                messages, lambda message: names in [s.name for s in message.status]
            )
            client.close()
            assert [s.level for s in warned.status if s.name == names] == [DiagnosticStatus.WARN]
        first.wait_output("no other process serves nodes of the same names any more")
