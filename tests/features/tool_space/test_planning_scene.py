"""Messages of MoveIt's planning scene as objects of the scene of an arm."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from robotd.api import FloatArray, InvalidArgument
from robotd_tool_space.collision.planning_scene import PlanningObject, changed_objects
from robotd_tool_space.collision.scene_object import SceneObject
from robotd_tool_space.geometry.rotations import inverse_pose, pose_of

pytest.importorskip("rclpy", reason="no ROS in this environment")

from geometry_msgs.msg import Point, Point32, Pose, Quaternion
from moveit_msgs.msg import AttachedCollisionObject, CollisionObject, PlanningScene
from shape_msgs.msg import Mesh, MeshTriangle, Plane, SolidPrimitive

TOOL = pose_of([0.4, 0.0, 0.5], [0.0, math.pi, 0.0])
TABLE = pose_of([1.0, 0.0, 0.2], [0.0, 0.0, math.pi / 2])


class Frames:
    """An arm with the frames ``base``, ``tool``, a table, and a hand at 0.1 m from the tool."""

    def in_base(self, frame: str) -> FloatArray:
        known = {"": np.eye(4), "base": np.eye(4), "table": TABLE, "tool": TOOL}
        if frame not in known:
            raise InvalidArgument(f"no frame {frame!r}")
        return known[frame]

    def in_tool(self, frame: str) -> FloatArray:
        if frame == "hand":
            return pose_of([0.0, 0.0, 0.1])
        return inverse_pose(TOOL) @ self.in_base(frame)

    def tool_in_base(self) -> FloatArray:
        return TOOL

    def carries(self, link: str) -> bool:
        return link in ("tool", "hand")


def at(x: float, y: float = 0.0, z: float = 0.0) -> Pose:
    return Pose(position=Point(x=x, y=y, z=z))


def solid(kind: int, *dimensions: float) -> SolidPrimitive:
    return SolidPrimitive(type=kind, dimensions=dimensions)


BALL = solid(SolidPrimitive.SPHERE, 0.1)


def ball(name: str, pose: Pose, **fields: Any) -> CollisionObject:
    message = CollisionObject(id=name, primitives=[BALL], primitive_poses=[pose], **fields)
    message.header.frame_id = "base"
    return message


class Scene:
    """A planning scene that messages change, as one arm has it."""

    def __init__(self, *objects: CollisionObject) -> None:
        self.known: dict[str, PlanningObject] = {}
        self.change(*objects)

    def change(
        self, *objects: CollisionObject, attached: Any = (), is_diff: bool = True, keep: bool = True
    ) -> None:
        message = PlanningScene(is_diff=is_diff)
        message.robot_state.is_diff = keep
        message.robot_state.attached_collision_objects = list(attached)
        message.world.collision_objects = list(objects)
        self.known = changed_objects(message, self.known, Frames())

    def attach(self, link: str, item: CollisionObject, *touch: str) -> None:
        message = AttachedCollisionObject(link_name=link, object=item, touch_links=touch)
        self.change(attached=[message])

    @property
    def items(self) -> dict[str, SceneObject]:
        items = [item for name, one in self.known.items() for item in one.items(name)]
        return {item.name: item.checked() for item in items}

    def place(self, name: str) -> list[float]:
        place: list[float] = self.items[name].pose[:3, 3].round(6).tolist()
        return place


@pytest.mark.parametrize(
    ("message", "shape", "size_m", "place"),
    [
        (solid(SolidPrimitive.BOX, 0.1, 0.2, 0.3), "box", (0.1, 0.2, 0.3), [1.0, 0.0, 0.0]),
        (solid(SolidPrimitive.CYLINDER, 0.4, 0.1), "cylinder", (0.1, 0.4), [1.0, 0.0, 0.0]),
        (solid(SolidPrimitive.CONE, 0.4, 0.1), "cylinder", (0.1, 0.4), [1.0, 0.0, 0.0]),
        (BALL, "sphere", (0.1,), [1.0, 0.0, 0.0]),
    ],
)
def test_solids(
    message: SolidPrimitive, shape: str, size_m: tuple[float, ...], place: list[float]
) -> None:
    scene = Scene(CollisionObject(id="a", primitives=[message], primitive_poses=[at(1.0)]))
    item = scene.items["a"]
    assert (item.shape, item.size_m, item.in_planning_scene) == (shape, size_m, True)
    assert scene.place("a") == place


def test_a_prism_and_a_mesh_are_boxes_around_them() -> None:
    corners = [Point32(x=x, y=y) for x, y in ((0.0, 0.0), (0.2, 0.0), (0.0, 0.4))]
    prism = solid(SolidPrimitive.PRISM, 0.6)
    prism.polygon.points = corners
    vertices = [Point(x=x, y=y, z=1.0) for x, y in ((0.0, 0.0), (0.2, 0.0), (0.0, 0.4))]
    mesh = Mesh(vertices=vertices, triangles=[MeshTriangle(vertex_indices=[0, 1, 2])])
    scene = Scene(
        CollisionObject(id="prism", primitives=[prism], primitive_poses=[at(1.0)]),
        CollisionObject(id="mesh", meshes=[mesh], mesh_poses=[at(1.0)]),
    )
    assert scene.items["prism"].size_m == pytest.approx((0.2, 0.4, 0.6))
    assert scene.place("prism") == [1.1, 0.2, 0.0]
    assert scene.items["mesh"].size_m == pytest.approx((0.2, 0.4, 0.001))
    assert scene.place("mesh") == [1.1, 0.2, 1.0]


def test_a_plane_has_its_free_side_along_its_normal() -> None:
    scene = Scene(CollisionObject(id="a", planes=[Plane(coef=[0.0, 0.0, 2.0, 0.5])]))
    item = scene.items["a"]
    assert item.shape == "plane"
    assert item.pose[:3, 2] == pytest.approx([0.0, 0.0, 1.0])
    assert scene.place("a") == [0.0, 0.0, -0.25]


def test_poses_are_in_the_object_which_is_in_the_frame() -> None:
    message = CollisionObject(id="a", primitives=[BALL, BALL], pose=at(0.0, 0.0, 0.1))
    message.header.frame_id = "table"
    message.primitive_poses = [at(0.5)]  # the other one is at the pose of the object
    scene = Scene(message)
    assert scene.place("a/1") == [1.0, 0.5, 0.3]
    assert scene.place("a/2") == [1.0, 0.0, 0.3]


def test_all_operations() -> None:
    scene = Scene(ball("a", at(1.0)), ball("b", at(2.0)))
    more = ball("a", at(0.0, 0.5), operation=CollisionObject.APPEND)
    scene.change(more)
    assert scene.place("a/1") == [1.0, 0.0, 0.0]
    scene.change(ball("c", at(3.0), operation=CollisionObject.APPEND))
    move = CollisionObject(id="a", pose=at(5.0), operation=CollisionObject.MOVE)
    scene.change(move)
    assert scene.place("a/1") == [5.0, 0.0, 0.0]
    scene.change(ball("a", at(1.0)))
    assert [*scene.items] == ["a", "b", "c"], "ADD replaces"
    scene.change(CollisionObject(id="b", operation=CollisionObject.REMOVE))
    scene.change(CollisionObject(id="unknown", operation=CollisionObject.REMOVE))
    assert [*scene.items] == ["a", "c"]
    scene.change(CollisionObject(operation=CollisionObject.REMOVE))
    assert scene.items == {}


def test_move_with_poses_of_the_shapes() -> None:
    scene = Scene(CollisionObject(id="a", primitives=[BALL, BALL], pose=at(1.0)))
    move = CollisionObject(id="a", pose=at(2.0), operation=CollisionObject.MOVE)
    move.primitive_poses = [at(0.1), at(0.2)]
    scene.change(move)
    assert (scene.place("a/1"), scene.place("a/2")) == ([2.1, 0.0, 0.0], [2.2, 0.0, 0.0])


def test_attaching_and_detaching() -> None:
    scene = Scene(ball("a", at(0.4, 0.1, 0.3)))
    scene.attach("hand", CollisionObject(id="a"), "finger")
    item = scene.items["a"]
    assert (item.attached, item.touch_links) == (True, {"finger"})
    assert scene.place("a") == [0.0, 0.1, 0.2], "in the link of the tool, which looks down"
    scene.change(CollisionObject(id="a", operation=CollisionObject.REMOVE))
    assert scene.items["a"].attached, "REMOVE is about objects of the world"
    scene.attach("hand", CollisionObject(id="a", operation=CollisionObject.REMOVE))
    assert not scene.items["a"].attached
    assert scene.place("a") == [0.4, 0.1, 0.3]
    new = ball("b", at(0.0, 0.0, 0.2))
    new.header.frame_id = "hand"
    scene.attach("hand", new)
    assert scene.place("b") == [0.0, 0.0, 0.3]
    scene.attach("hand", CollisionObject(operation=CollisionObject.REMOVE))
    assert not scene.items["b"].attached


def test_a_state_that_is_no_difference_has_all_that_is_attached() -> None:
    scene = Scene(ball("a", at(0.4)), ball("b", at(1.0)))
    scene.attach("tool", CollisionObject(id="a"))
    scene.change(keep=False)
    assert [*scene.items] == ["b"]
    scene.change(ball("c", at(1.0)), is_diff=False)
    assert [*scene.items] == ["c"]


@pytest.mark.parametrize(
    ("message", "text"),
    [
        (CollisionObject(id="a", primitives=[solid(9, 1.0)]), "a: primitive has type 9"),
        (CollisionObject(id="a", primitives=[solid(1, 1.0)]), "a: primitive has 1 dimensions, a "),
        (CollisionObject(id="a", primitives=[solid(5, 1.0)]), "a: prism has 0 corners"),
        (CollisionObject(id="a", meshes=[Mesh()]), "a: mesh has 0 vertices"),
        (
            CollisionObject(
                id="a", meshes=[Mesh(vertices=[Point(x=math.inf)], triangles=[MeshTriangle()])]
            ),
            "a: a vertex is not finite",
        ),
        (
            CollisionObject(id="a", meshes=[Mesh(vertices=[Point(), Point(x=1.0), Point(y=1.0)])]),
            "a: mesh has no triangles",
        ),
        (CollisionObject(id="a", planes=[Plane(coef=[0.0, 0.0, 0.0, 1.0])]), "a: plane has"),
        (
            CollisionObject(id="a", planes=[Plane(coef=[math.nan, 0.0, 1.0, 1.0])]),
            "a: plane has coefficients",
        ),
        (CollisionObject(id="a"), "a: has no shape"),
        (
            CollisionObject(id="a", primitives=[BALL], primitive_poses=[at(1.0), at(2.0)]),
            "a: has 2 poses of 1 primitives",
        ),
        (ball("a", Pose(orientation=Quaternion(w=0.0))), "a: quaternion"),
        (ball("a", at(0.0), operation=bytes([7])), "a: operation is 7, must be 0 to 3"),
        (ball("a", at(0.0), operation=CollisionObject.MOVE), "a: no object of the planning scene"),
    ],
)
def test_what_cannot_be_is_rejected_by_name(message: CollisionObject, text: str) -> None:
    with pytest.raises(InvalidArgument, match=text):
        Scene(message)
