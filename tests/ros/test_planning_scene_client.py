"""Objects that ``move_group`` had before robotd was connected, over DDS."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Point
from moveit_msgs.msg import CollisionObject
from robotd_msgs.msg import Scene
from shape_msgs.msg import Mesh
from tests.ros.move_group_emulator import MoveGroup
from tests.ros.robot_process import LATCHED, Client, RobotProcess, connected, wait_until
from tests.ros.test_planning_scene import NAN, attached, box
from tests.ros.test_scene import BENT, CHANGE, at, change, names, place
from tests.ros.test_trajectory import goal

from robotd_testing.domain import own_domain

pytestmark = pytest.mark.ros

KEYS = "tool_space.collisions={planning_scene_topic: monitored_planning_scene}"
RECEIVED, REJECTED = "planning scene of MoveIt", "planning scene rejected"
NO_RESPONSE = "no planning scene from MoveIt"
FAR = at(2.0, 0.0, 0.0)


def wait_names(seen: list[Any], *expected: str) -> None:
    wait_until(lambda: seen and names(seen) == [*expected], f"{expected} in the scene")


@pytest.fixture(scope="module")
def arm() -> Iterator[RobotProcess]:
    with RobotProcess("--set", KEYS, simulated_time=True) as process:
        process.wait_ready()
        yield process


@pytest.fixture(scope="module")
def client(arm: RobotProcess) -> Iterator[Client]:
    with connected(arm) as client:
        yield client


@pytest.fixture
def seen(client: Client) -> list[Any]:
    """Scenes of the robot, the first of them empty."""
    assert change(client, CHANGE.REMOVE).success
    seen = client.listen(Scene, "/robotd/scene", LATCHED)
    wait_names(seen)
    return seen


def test_move_group_before_robotd() -> None:
    part = attached("link6", box("part", at(0.0, 0.0, 0.2), 0.02, 0.02, 0.02, frame="link6"))
    with (
        own_domain() as domain,
        MoveGroup(domain, [box("shelf", FAR)], [part]) as move_group,
        RobotProcess("--set", KEYS, domain=domain, simulated_time=True) as process,
    ):
        process.wait_ready()
        with connected(process) as client:
            seen = client.listen(Scene, "/robotd/scene", LATCHED)
            wait_names(seen, "part", "shelf")
            assert [item.attached for item in seen[-1].objects] == [True, False]
            move_group.change(box("crate", at(3.0, 0.0, 0.0)), removed=["shelf"])
            wait_names(seen, "part", "crate")
            assert move_group.requests == 1


def test_robotd_before_move_group(arm: RobotProcess, seen: list[Any]) -> None:
    with MoveGroup(arm.domain, [box("shelf", FAR)]) as move_group:
        wait_names(seen, "shelf")
        move_group.change(removed=["shelf"])
        wait_names(seen)


def test_a_change_after_the_request_is_not_undone_by_the_response(
    arm: RobotProcess, seen: list[Any]
) -> None:
    received = arm.output.count(RECEIVED)
    with MoveGroup(arm.domain, [box("old", FAR)]) as move_group:
        move_group.answering.clear()
        wait_until(lambda: move_group.requests, "a request")
        move_group.change(box("new", FAR), removed=["old"])
        move_group.answering.set()
        wait_until(lambda: arm.output.count(RECEIVED) > received, "the response")
        move_group.change(box("next", FAR))
        wait_names(seen, "new", "next")


def test_a_response_is_requested_anew_while_the_arm_moves(
    arm: RobotProcess, client: Client, seen: list[Any]
) -> None:
    """An object in the frame of a moving link is placed where the arm rests."""
    rejected = arm.output.count(REJECTED)
    run = client.send_goal(goal((8.0, [0.5] * 6)))
    with MoveGroup(arm.domain, [box("near", at(0.0, 0.0, 0.5), frame="link6")]) as move_group:
        wait_until(lambda: move_group.requests > 1, "a second request")
        assert not run.done
        wait_names(seen, "near")
        assert run.result()[0] == GoalStatus.STATUS_SUCCEEDED
        assert arm.output.count(REJECTED) == rejected + 1


def test_the_scene_of_a_restarted_move_group_replaces_the_one_before(
    arm: RobotProcess, seen: list[Any]
) -> None:
    with MoveGroup(arm.domain, [box("before", FAR)]):
        wait_names(seen, "before")
    with MoveGroup(arm.domain, [box("after", FAR)]):
        wait_names(seen, "after")


def test_a_service_without_a_publisher_on_the_topic(arm: RobotProcess, seen: list[Any]) -> None:
    """As with ``planning_scene``, which ``move_group`` subscribes to."""
    with MoveGroup(arm.domain, [box("shelf", FAR)], topic="another"):
        wait_names(seen, "shelf")


def test_a_goal_into_an_object_of_the_response_is_rejected_with_its_name(
    arm: RobotProcess, client: Client, seen: list[Any]
) -> None:
    turned = goal((3.0, [2.0, *BENT[1:]]))
    assert client.send_goal(turned).result()[0] == GoalStatus.STATUS_SUCCEEDED
    there = place(client)
    assert client.send_goal(goal((3.0, BENT))).result()[0] == GoalStatus.STATUS_SUCCEEDED
    with MoveGroup(arm.domain, [box("post", at(there.x, there.y, there.z), 0.1, 0.1, 1.0)]):
        wait_names(seen, "post")
        status, result = client.send_goal(turned).result()
        assert status == GoalStatus.STATUS_ABORTED
        assert "and post would" in result.error_string


def test_a_service_that_does_not_respond_is_logged_once_and_messages_are_applied(
    arm: RobotProcess, seen: list[Any]
) -> None:
    with MoveGroup(arm.domain) as move_group:
        move_group.answering.clear()
        wait_until(lambda: move_group.requests, "a request")
        move_group.change(box("new", FAR))
        wait_names(seen, "new")
        wait_until(lambda: NO_RESPONSE in arm.output, "the warning")
        move_group.change(box("next", FAR))
        wait_names(seen, "new", "next")
        assert arm.output.count(NO_RESPONSE) == 1


FLAT = Mesh(vertices=[Point(), Point(x=1.0), Point(y=1.0)])
BAD = {
    "bad: frame 'camera'": box("bad", FAR, frame="camera"),
    "bad: pose": box("bad", at(NAN, 0.0, 0.0)),
    "bad: mesh has no triangles": CollisionObject(id="bad", meshes=[FLAT], mesh_poses=[FAR]),
}


@pytest.mark.parametrize("text", BAD)
def test_a_response_with_a_mistake_is_logged_once_and_changes_nothing(
    arm: RobotProcess, seen: list[Any], text: str
) -> None:
    rejected = arm.output.count(REJECTED)
    with MoveGroup(arm.domain, [box("good", FAR), BAD[text]]) as move_group:
        wait_until(lambda: text in arm.output, "the reason")
        move_group.change(box("next", FAR))
        wait_names(seen, "next")
        assert move_group.requests == 1
        assert arm.output.count(REJECTED) == rejected + 1


def test_a_pending_request_does_not_delay_the_shutdown() -> None:
    with (
        own_domain() as domain,
        MoveGroup(domain) as move_group,
        RobotProcess("--set", KEYS, domain=domain, simulated_time=True) as process,
    ):
        move_group.answering.clear()
        wait_until(lambda: move_group.requests, "a request")
        process.wait_ready()
        assert process.end() == 0
        assert "Traceback" not in process.output
        assert "at shut-down" not in process.output
