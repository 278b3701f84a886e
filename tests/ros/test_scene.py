"""A scene that changes over DDS: the service, the topic, goals, twists and the commands."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Point, Pose, Quaternion
from robotd_msgs.action import MoveTool
from robotd_msgs.msg import Scene, SceneObject
from robotd_msgs.srv import ChangeScene, ComputeFk
from tests.ros.action_client import GoalClient
from tests.ros.robot_process import LATCHED, Client, RobotProcess, connected, wait_for, wait_until
from tests.ros.test_client_commands import robotd
from tests.ros.test_trajectory import goal

pytestmark = pytest.mark.ros

BENT = [0.0, 0.3, 1.4, -0.2, 1.2, 0.0]
SERVICE = "/robotd/change_scene"
CHANGE = ChangeScene.Request
FLOOR = "tool_space.collisions={planes: {floor: {normal: [0, 0, 1], distance_m: -0.5}}}"


@pytest.fixture(scope="module")
def arm() -> Iterator[RobotProcess]:
    with RobotProcess("--set", FLOOR, simulated_time=True) as process:
        process.wait_ready()
        yield process


@pytest.fixture(scope="module")
def client(arm: RobotProcess) -> Iterator[Client]:
    with connected(arm) as client:
        assert client.send_goal(goal((3.0, BENT))).result()[0] == GoalStatus.STATUS_SUCCEEDED
        yield client


@pytest.fixture(scope="module")
def topic(client: Client) -> list[Any]:
    messages = client.listen(Scene, "/robotd/scene", LATCHED)
    wait_until(lambda: messages, "the scene")
    return messages


def change(client: Client, operation: int, **fields: Any) -> Any:
    return client.call(ChangeScene, SERVICE, operation=operation, object=SceneObject(**fields))


def place(client: Client) -> Point:
    return client.call(ComputeFk, "/robotd/compute_fk").pose_stamped.pose.position


def at(x: float, y: float, z: float) -> Pose:
    return Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(w=1.0))


def names(topic: list[Any]) -> list[str]:
    return [item.name for item in topic[-1].objects]


def test_objects_are_added_carried_and_removed(client: Client, topic: list[Any]) -> None:
    assert names(topic) == ["floor"]
    assert topic[-1].objects[0].in_file
    here = place(client)
    above = {"shape": "box", "size_m": [0.3, 0.3, 0.05], "pose": at(here.x, here.y, here.z + 0.2)}
    answer = change(client, CHANGE.ADD, name="shelf", **above)
    assert (answer.success, answer.message) == (True, "shelf added")
    wait_until(lambda: names(topic) == ["floor", "shelf"], "the topic has it")
    action = GoalClient(client.node, MoveTool, "/robotd/move_tool")
    wait_until(action.server_is_ready, "no action")
    up = MoveTool.Goal(
        frame=MoveTool.Goal.RELATIVE_BASE,
        poses=[Pose(position=Point(z=0.1))],
        line=True,
        plan_only=True,
    )
    refused = wait_for(wait_for(action.send_goal_async(up)).get_result_async())
    assert refused.status == GoalStatus.STATUS_ABORTED
    assert "and shelf would" in refused.result.message
    assert change(client, CHANGE.REMOVE, name="shelf").success
    accepted = wait_for(wait_for(action.send_goal_async(up)).get_result_async())
    assert accepted.result.success, accepted.result.message
    small = {"shape": "sphere", "size_m": [0.02], "pose": at(here.x, here.y, here.z - 0.2)}
    assert change(client, CHANGE.ADD, name="part", **small).success
    assert change(client, CHANGE.ATTACH, name="part").success
    wait_until(lambda: topic[-1].objects[-1].attached, "the topic has it")
    assert change(client, CHANGE.DETACH, name="part").success
    assert change(client, CHANGE.MOVE, name="part", pose=at(0.0, 0.0, 2.0)).success
    wait_until(lambda: topic[-1].objects[-1].pose.position.z == pytest.approx(2.0), "it moved")
    assert change(client, CHANGE.REMOVE).message == "1 objects removed"
    wait_until(lambda: names(topic) == ["floor"], "it is gone")


def test_the_planning_scene_is_received_on_request_only(client: Client, topic: list[Any]) -> None:
    types = [kind for _, kinds in client.node.get_topic_names_and_types() for kind in kinds]
    assert "robotd_msgs/msg/Scene" in types
    assert "moveit_msgs/msg/PlanningScene" not in types


@pytest.mark.parametrize(
    ("operation", "fields", "text"),
    [
        (CHANGE.REMOVE, {"name": "floor"}, "floor belongs to the robot's file: change it there"),
        (CHANGE.REMOVE, {"name": "flor"}, "no object 'flor' in the scene"),
        (9, {"name": "a"}, "operation is 9, must be 0 to 4"),
        (CHANGE.ADD, {"name": "a", "shape": "cone"}, "a: no shape 'cone'"),
        (CHANGE.ADD, {"name": "a", "shape": "plane", "group": "left"}, "group 'left' is none of"),
        (
            CHANGE.ADD,
            {"name": "a", "shape": "plane", "pose": Pose(orientation=Quaternion(w=0.0))},
            "quaternion",
        ),
    ],
)
def test_requests_that_cannot_be_are_answered(
    client: Client, operation: int, fields: dict[str, Any], text: str
) -> None:
    answer = change(client, operation, **fields)
    assert not answer.success
    assert text in answer.message


def test_a_goal_under_way_is_stopped_by_what_is_added(client: Client, topic: list[Any]) -> None:
    assert client.send_goal(goal((3.0, [2.0, *BENT[1:]]))).result()[0] == (
        GoalStatus.STATUS_SUCCEEDED
    )
    there = place(client)
    assert client.send_goal(goal((3.0, BENT))).result()[0] == GoalStatus.STATUS_SUCCEEDED
    run = client.send_goal(goal((60.0, [2.0, *BENT[1:]])))
    post = {"shape": "cylinder", "size_m": [0.03, 1.0], "pose": at(there.x, there.y, there.z)}
    answer = change(client, CHANGE.ADD, name="post", **post)
    assert "motion is stopped: the scene has changed: at " in answer.message
    status, result = run.result()
    assert status == GoalStatus.STATUS_ABORTED
    assert "and post would" in result.error_string
    assert change(client, CHANGE.REMOVE, name="post").success
    assert client.send_goal(goal((3.0, BENT))).result()[0] == GoalStatus.STATUS_SUCCEEDED


def test_the_commands(arm: RobotProcess, client: Client, topic: list[Any]) -> None:
    words = ["crate", "box", "0.4", "0.3", "0.2", "x=2", "z=0.1", "yaw=90", "--deg"]
    assert robotd(arm.domain, "scene", "add", *words)[:2] == (0, "crate added\n")
    status, output, _ = robotd(arm.domain, "scene", "list")
    assert status == 0
    floor, crate = output.splitlines()
    assert floor.split()[:2] == ["floor", "plane"]
    assert "(of the robot's file)" in floor
    assert " ".join(crate.split()) == "crate box 0.4 x 0.3 x 0.2 x=2 z=0.1 yaw=1.5708"
    assert robotd(arm.domain, "scene", "move", "crate", "x=3")[:2] == (0, "crate moved\n")
    assert robotd(arm.domain, "scene", "attach", "crate")[0] == 0
    assert robotd(arm.domain, "scene", "detach", "crate")[0] == 0
    assert robotd(arm.domain, "scene", "remove", "--all")[:2] == (0, "1 objects removed\n")
    status, _, error = robotd(arm.domain, "scene", "remove", "floor")
    assert status != 0
    assert "floor belongs to the robot's file: change it there" in error
    status, _, error = robotd(arm.domain, "scene", "add", "a", "box", "1", "2")
    assert status != 0
    assert "a box needs X Y Z, not '1 2'" in error
