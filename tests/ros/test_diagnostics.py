"""/diagnostics and the robot's description, as monitors and RViz see them."""

from __future__ import annotations

from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from std_msgs.msg import String
from tests.fakes import FakeClock
from tests.ros.robot_process import LATCHED, Client, RobotProcess, wait_until
from wmx_ros2_message.srv import SetAxis

from robotd.descriptor import load_robot_descriptor
from robotd.robot import build_robot
from robotd_ros.diagnostics.diagnostics_publisher import CHECK_PERIOD_S, Diagnostics
from robotd_ros.diagnostics.part_status import DiagnosticLevel
from robotd_ros.host import RosHost
from robotd_ros.nodes.operator_node import OperatorNode

pytestmark = [pytest.mark.daily, pytest.mark.ros]

TOPIC = "/diagnostics"
OK, WARN = DiagnosticStatus.OK, DiagnosticStatus.WARN


def levels(message: Any) -> dict[str, bytes]:
    return {status.name: status.level for status in message.status}


def test_the_levels_are_those_of_ros() -> None:
    for level in DiagnosticLevel:
        assert bytes([level]) == getattr(DiagnosticStatus, level.name)


def test_every_part_is_told_once_a_second(client: Client) -> None:
    messages = client.listen(DiagnosticArray, TOPIC)
    wait_until(lambda: len(messages) >= 4, "four messages")
    stamps = [m.header.stamp.sec + m.header.stamp.nanosec * 1e-9 for m in messages[1:4]]
    assert stamps[2] - stamps[0] < 2.5
    found = levels(messages[-1])
    joints = [f"joint{number}" for number in range(1, 7)]
    parts = ["engine", "motion", *joints, "fieldbus", "gripper"]
    assert found.items() >= {f"robotd/cr3a: {part}": OK for part in parts}.items()
    assert set(found) - {f"robotd/cr3a: {part}" for part in parts} == {"robotd/cr3a: cycle"}
    assert {status.hardware_id for status in messages[-1].status} == {"cr3a"}


def test_the_cycle_tells_how_it_keeps_its_time(client: Client) -> None:
    messages = client.listen(DiagnosticArray, TOPIC)
    status = next(s for s in client.next(messages).status if s.name.endswith(": cycle"))
    values = {value.key: value.value for value in status.values}
    assert values["wanted rate (Hz)"] == "500"
    assert float(values["rate (Hz)"]) > 0
    assert {"lateness p50 (µs)", "lateness p99 (µs)", "lateness max (µs)"} < set(values)
    assert {"missed deadlines", "real-time priority"} < set(values)


def test_a_change_is_told(client: Client) -> None:
    messages = client.listen(DiagnosticArray, TOPIC)
    client.next(messages)
    name = "robotd/cr3a: joint4"
    try:
        assert client.call(SetAxis, "/wmx/axis/set_on", index=[3], data=[0]).success
        message = client.next(messages, lambda m: levels(m)[name] != OK)
        (status,) = (status for status in message.status if status.name == name)
        assert (status.level, status.message) == (WARN, "servo off")
    finally:
        assert client.call(SetAxis, "/wmx/axis/set_on", index=[3], data=[1]).success
    client.next(messages, lambda m: levels(m)[name] == OK)


def test_the_description_is_latched_and_readable(client: Client) -> None:
    path = load_robot_descriptor("cr3a").urdf
    assert path is not None
    text = path.read_text(encoding="utf-8")
    messages = client.listen(String, "/robot_description", LATCHED)
    wait_until(lambda: messages, "the description")
    assert messages[0].data == text
    response = client.call(
        GetParameters, "/manipulator_state/get_parameters", names=["robot_description"]
    )
    assert response.values[0].string_value == text


def test_a_description_of_one_s_own_takes_the_place_of_the_robot_s() -> None:
    arguments = ["-p", "robot_description:=<robot name='mine'/>"]
    with RobotProcess("--nodes", "manipulator_state", "--ros-args", *arguments) as process:
        process.wait_ready()
        client = Client(process.domain)
        try:
            messages = client.listen(String, "/robot_description", LATCHED)
            wait_until(lambda: messages, "the description")
            assert messages[0].data == "<robot name='mine'/>"
        finally:
            client.close()


def test_it_is_told_each_second_and_at_every_change(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    clock = FakeClock()
    monkeypatch.setattr("robotd_ros.diagnostics.diagnostics_publisher.MonotonicClock", clock)
    robot = build_robot("standalone", "sim")
    told: list[Any] = []
    with RosHost(domain_id=97) as host:
        node = Node("any", context=host.context)
        diagnostics = Diagnostics([node], robot, OperatorNode(robot, host))
        monkeypatch.setattr(diagnostics, "_publish", told.append)

        def told_within(seconds: float) -> int:
            before = len(told)
            for _ in range(round(seconds / CHECK_PERIOD_S)):
                clock.advance(CHECK_PERIOD_S)
                diagnostics._check()
            return len(told) - before

        assert told_within(CHECK_PERIOD_S) == 1
        while not told_within(CHECK_PERIOD_S):
            pass
        assert told_within(5.0) == 5
        assert told_within(0.3) == 0
        robot.connection.open()
        assert told_within(CHECK_PERIOD_S) == 1
        assert told_within(0.3) == 0
        assert told_within(5.0) == 5
        robot.connection.shutdown()


def test_one_look_serves_diagnostics_problems_and_summary(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    robot = build_robot("standalone", "sim")
    problems: list[Any] = []
    summaries: list[Any] = []
    with RosHost(domain_id=97) as host:
        node = Node("any", context=host.context)
        node.create_subscription(DiagnosticArray, "/robotd/problems", problems.append, LATCHED)
        node.create_subscription(String, "/robotd/summary", summaries.append, LATCHED)
        host.add_node(node)
        diagnostics = Diagnostics([node], robot, OperatorNode(robot, host))
        looks: list[int] = []
        find = robot.find_problems
        monkeypatch.setattr(robot, "find_problems", lambda: looks.append(1) or find())
        diagnostics._check()
        assert len(looks) == 1
        wait_until(lambda: problems and summaries, "both")
    assert '"state": "no device"' in summaries[0].data


def test_in_a_namespace_the_names_tell_whose_it_is_and_the_end_is_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    robot = build_robot("standalone", "sim")
    messages: list[Any] = []
    with RosHost(domain_id=97) as host:
        node = Node("any", namespace="left", context=host.context)
        node.create_subscription(DiagnosticArray, TOPIC, messages.append, 10)
        host.add_node(node)
        with Diagnostics([node], robot, OperatorNode(robot, host)):
            wait_until(lambda: messages, "the first message")
            robot.start()
            wait_until(lambda: levels(messages[-1])["robotd/left/standalone: engine"] == OK, "up")
            robot.shutdown()
        wait_until(lambda: messages[-1].status[0].message.startswith("Shutdown"), "the last one")
    parts = {"engine", "motion", "axis 0", "axis 1", "fieldbus", "cycle"}
    assert set(levels(messages[-1])) == {f"robotd/left/standalone: {part}" for part in parts}
    assert messages[-1].status[0].hardware_id == "left/standalone"
