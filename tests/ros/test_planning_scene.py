"""MoveIt's planning scene over DDS: messages as MoveIt's clients and move_group publish them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Point, Pose, Quaternion
from moveit_msgs.msg import AttachedCollisionObject, CollisionObject, PlanningScene
from robotd_msgs.action import MoveTool
from robotd_msgs.msg import Scene
from shape_msgs.msg import Mesh, Plane, SolidPrimitive
from tests.ros.action_client import GoalClient
from tests.ros.robot_process import LATCHED, Client, RobotProcess, connected, wait_for, wait_until
from tests.ros.test_scene import BENT, CHANGE, at, change, names, place
from tests.ros.test_trajectory import goal

pytestmark = pytest.mark.ros

TOPIC = "planning_scene"
KEYS = (
    "tool_space.collisions={planning_scene_topic: planning_scene,"
    " planes: {floor: {normal: [0, 0, 1], distance_m: -0.5}}}"
)
NAN = math.nan


@pytest.fixture(scope="module")
def arm() -> Iterator[RobotProcess]:
    with RobotProcess("--set", KEYS, simulated_time=True) as process:
        process.wait_ready()
        yield process


@pytest.fixture(scope="module")
def client(arm: RobotProcess) -> Iterator[Client]:
    with connected(arm) as client:
        assert client.send_goal(goal((3.0, BENT))).result()[0] == GoalStatus.STATUS_SUCCEEDED
        yield client


class MoveIt:
    """A client that publishes differences of a planning scene, and sees what the robot has."""

    def __init__(self, client: Client) -> None:
        self._publisher = client.node.create_publisher(PlanningScene, TOPIC, 1)
        wait_until(lambda: self._publisher.get_subscription_count() == 1, "no subscription")
        self.seen = client.listen(Scene, "/robotd/scene", LATCHED)
        wait_until(lambda: self.seen, "the scene")
        self._move = GoalClient(client.node, MoveTool, "/robotd/move_tool")
        wait_until(self._move.server_is_ready, "no action")

    def publish(
        self,
        *objects: CollisionObject,
        attached: Sequence[AttachedCollisionObject] = (),
        is_diff: bool = True,
    ) -> None:
        message = PlanningScene(is_diff=is_diff)
        message.robot_state.is_diff = is_diff
        message.robot_state.attached_collision_objects = list(attached)
        message.world.collision_objects = list(objects)
        self._publisher.publish(message)

    def publish_message(self, message: PlanningScene) -> None:
        self._publisher.publish(message)

    def wait_names(self, *expected: str) -> None:
        wait_until(lambda: names(self.seen) == ["floor", *expected], f"{expected} in the scene")

    def object(self, name: str) -> Any:
        (found,) = [item for item in self.seen[-1].objects if item.name == name]
        return found

    def line_up(self) -> str:
        """Return the reason why a line up cannot be executed; "": it can."""
        up = MoveTool.Goal(
            frame=MoveTool.Goal.RELATIVE_BASE,
            poses=[Pose(position=Point(z=0.1))],
            line=True,
            plan_only=True,
        )
        answer = wait_for(wait_for(self._move.send_goal_async(up)).get_result_async())
        return "" if answer.result.success else answer.result.message


@pytest.fixture(scope="module")
def moveit(client: Client) -> MoveIt:
    return MoveIt(client)


@pytest.fixture(autouse=True)
def empty_scene(client: Client, moveit: MoveIt) -> None:
    assert change(client, CHANGE.REMOVE).success
    moveit.wait_names()


def box(name: str, pose: Pose, *size: float, frame: str = "base_link") -> CollisionObject:
    solid = SolidPrimitive(type=SolidPrimitive.BOX, dimensions=size or (0.3, 0.3, 0.05))
    message = CollisionObject(id=name, primitives=[solid], primitive_poses=[pose])
    message.header.frame_id = frame
    return message


def moved(name: str, pose: Pose) -> CollisionObject:
    message = CollisionObject(id=name, pose=pose, operation=CollisionObject.MOVE)
    message.header.frame_id = "base_link"
    return message


def removed(name: str) -> CollisionObject:
    return CollisionObject(id=name, operation=CollisionObject.REMOVE)


def attached(link: str, item: CollisionObject) -> AttachedCollisionObject:
    return AttachedCollisionObject(link_name=link, object=item)


def test_lines_are_rejected_by_what_is_added_until_it_moves_away(
    client: Client, moveit: MoveIt
) -> None:
    here = place(client)
    above = at(here.x, here.y, here.z + 0.2)
    assert moveit.line_up() == ""
    moveit.publish(box("shelf", above))
    moveit.wait_names("shelf")
    assert "and shelf would" in moveit.line_up()
    moveit.publish(moved("shelf", at(2.0, 0.0, 0.0)))
    wait_until(lambda: moveit.object("shelf").pose.position.x == 2.0, "it moved")
    assert moveit.line_up() == ""
    moveit.publish(moved("shelf", above))
    wait_until(lambda: moveit.object("shelf").pose.position.x != 2.0, "it is back")
    assert "and shelf would" in moveit.line_up()
    moveit.publish(removed("shelf"))
    moveit.wait_names()
    assert moveit.line_up() == ""


def test_a_goal_under_way_is_stopped_by_what_is_added(client: Client, moveit: MoveIt) -> None:
    assert client.send_goal(goal((3.0, [2.0, *BENT[1:]]))).result()[0] == 4
    there = place(client)
    assert client.send_goal(goal((3.0, BENT))).result()[0] == GoalStatus.STATUS_SUCCEEDED
    run = client.send_goal(goal((60.0, [2.0, *BENT[1:]])))
    moveit.publish(box("post", at(there.x, there.y, there.z), 0.1, 0.1, 1.0))
    status, result = run.result()
    assert status == GoalStatus.STATUS_ABORTED
    assert "and post would" in result.error_string
    moveit.publish(removed("post"))
    moveit.wait_names()
    assert client.send_goal(goal((3.0, BENT))).result()[0] == GoalStatus.STATUS_SUCCEEDED


def test_what_is_attached_goes_with_the_tool(client: Client, moveit: MoveIt) -> None:
    here = place(client)
    moveit.publish(box("part", at(here.x, here.y, here.z - 0.3), 0.02, 0.02, 0.02))
    moveit.wait_names("part")
    moveit.publish(attached=[attached("link6", CollisionObject(id="part"))])
    wait_until(lambda: moveit.object("part").attached, "it is attached")
    turned = [0.5, *BENT[1:]]
    assert client.send_goal(goal((3.0, turned))).result()[0] == GoalStatus.STATUS_SUCCEEDED
    gone = CollisionObject(id="part", operation=CollisionObject.REMOVE)
    moveit.publish(attached=[attached("link6", gone)])
    wait_until(lambda: not moveit.object("part").attached, "it is detached")
    left = moveit.object("part").pose.position
    x = here.x * math.cos(0.5) - here.y * math.sin(0.5)
    y = here.x * math.sin(0.5) + here.y * math.cos(0.5)
    assert (left.x, left.y, left.z) == pytest.approx((x, y, here.z - 0.3), abs=1e-3)
    assert client.send_goal(goal((3.0, BENT))).result()[0] == GoalStatus.STATUS_SUCCEEDED


def test_objects_of_a_diff_of_move_group_after_attaching(moveit: MoveIt) -> None:
    """move_group repeats all attached objects, in the frames of their links."""
    whole = box("part", at(0.0, 0.0, 0.2), 0.02, 0.02, 0.02, frame="link6")
    moveit.publish(box("crate", at(2.0, 0.0, 0.0)), attached=[attached("link6", whole)])
    moveit.wait_names("part", "crate")
    assert moveit.object("part").pose.position.z == pytest.approx(0.2)
    count = len(moveit.seen)
    for _ in range(3):  # as its states do
        moveit.publish(attached=[attached("link6", whole)])
    moveit.publish(removed("crate"), attached=[attached("link6", whole)])
    moveit.wait_names("part")
    assert len(moveit.seen) == count + 1, "messages without a change change nothing"


def test_a_whole_scene_replaces_that_of_moveit_alone(client: Client, moveit: MoveIt) -> None:
    own = {"name": "own", "shape": "sphere", "size_m": [0.1], "pose": at(2.0, 2.0, 0.0)}
    assert change(client, CHANGE.ADD, **own).success
    moveit.publish(box("a", at(2.0, 0.0, 0.0)), box("b", at(3.0, 0.0, 0.0)))
    moveit.wait_names("own", "a", "b")
    answer = change(client, CHANGE.REMOVE, name="a")
    assert answer.message == "a belongs to MoveIt's planning scene: change it there"
    moveit.publish(box("c", at(2.0, 0.0, 0.0)), is_diff=False)
    moveit.wait_names("own", "c")
    moveit.publish(is_diff=False)
    moveit.wait_names("own")


def test_what_the_service_removes_stays_removed(client: Client, moveit: MoveIt) -> None:
    moveit.publish(box("a", at(2.0, 0.0, 0.0)))
    moveit.wait_names("a")
    assert change(client, CHANGE.REMOVE).success
    moveit.publish(box("b", at(2.0, 0.0, 0.0)))
    moveit.wait_names("b")


def with_mesh(count: int) -> CollisionObject:
    pose = at(2.0, 0.0, 0.0)
    mesh = Mesh(vertices=[Point()] * count)
    return CollisionObject(id="bad", meshes=[mesh], mesh_poses=[pose])


BAD = {
    "a NaN": (box("bad", at(NAN, 0.0, 0.0)), "bad: pose"),
    "a quaternion": (
        box("bad", Pose(orientation=Quaternion(w=2.0))),
        "bad: quaternion [0.0, 0.0, 0.0, 2.0] has length 2, must be 1",
    ),
    "a size": (box("bad", at(2.0, 0.0, 0.0), 0.1, 0.0, 0.1), "bad: size_m has 0, must be above 0"),
    "a frame": (
        box("bad", at(2.0, 0.0, 0.0), frame="camera"),
        "bad: frame 'camera': no transform of frame ",
    ),
    "a mesh": (with_mesh(50_001), "bad: mesh has 50001 vertices, must have 1 to 50000"),
    "a plane": (
        CollisionObject(id="bad", planes=[Plane()], plane_poses=[Pose()]),
        "bad: plane has coefficients",
    ),
    "no shape": (CollisionObject(id="bad"), "bad: has no shape"),
    "nothing to move": (moved("bad", Pose()), "bad: no object of the planning scene has this id"),
    "a name": (box("link3", at(2.0, 0.0, 0.0)), "'link3' is the name of a link or a tool"),
    "one of the file": (box("floor", at(2.0, 0.0, 0.0)), "floor belongs to the robot's file"),
    "a link": (
        attached("link3", box("bad", at(0.0, 0.0, 0.1), frame="link3")),
        "bad: link 'link3' is not fixed to a tool (available: link6",
    ),
}


@pytest.mark.parametrize("bad", BAD)
def test_a_message_with_a_mistake_changes_nothing(
    arm: RobotProcess, moveit: MoveIt, bad: str
) -> None:
    wrong, text = BAD[bad]
    good = box("good", at(2.0, 0.0, 0.0))
    if isinstance(wrong, AttachedCollisionObject):
        moveit.publish(good, attached=[wrong])
    else:
        moveit.publish(good, wrong)
    wait_until(lambda: text in arm.output, f"{text!r} in the log")
    moveit.publish(box("next", at(2.0, 0.0, 0.0)))
    moveit.wait_names("next")
    assert not any("good" in names([message]) for message in moveit.seen)


def test_an_octomap_is_named_once_and_the_rest_counts(arm: RobotProcess, moveit: MoveIt) -> None:
    message = PlanningScene(is_diff=True)
    message.robot_state.is_diff = True
    message.world.octomap.octomap.data = [1, 2, 3]
    for name in ("a", "b"):
        message.world.collision_objects = [box(name, at(2.0, 0.0, 0.0))]
        moveit.publish_message(message)
    moveit.wait_names("a", "b")
    wait_until(lambda: "octomap of the planning scene is ignored" in arm.output, "the log")
    assert arm.output.count("octomap of the planning scene is ignored") == 1


def test_a_frame_of_a_moving_link_is_where_the_arm_rests(client: Client, moveit: MoveIt) -> None:
    here = place(client)
    moveit.publish(box("near", at(0.0, 0.0, 0.0), 0.01, 0.01, 0.01, frame="link6"))
    moveit.wait_names("near")
    found = moveit.object("near").pose.position
    assert (found.x, found.y, found.z) == pytest.approx((here.x, here.y, here.z), abs=1e-3)
    assert not moveit.object("near").attached
