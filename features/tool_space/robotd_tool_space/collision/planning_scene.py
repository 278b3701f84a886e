"""Objects of MoveIt's planning scene for one arm, from messages ``moveit_msgs/PlanningScene``."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

import numpy as np

from robotd.api import FloatArray, InvalidArgument, get_logger
from robotd_tool_space.collision.bodies import pose_along
from robotd_tool_space.collision.scene_object import PLANE, SceneObject
from robotd_tool_space.geometry.rotations import inverse_pose, pose_of, pose_of_message

log = get_logger("tool")

ADD, REMOVE, APPEND, MOVE = range(4)  # operations of a CollisionObject
BOX, SPHERE, CYLINDER, CONE, PRISM = range(1, 6)  # types of a SolidPrimitive
SOLIDS = {BOX: ("box", 3), SPHERE: ("sphere", 1), CYLINDER: ("cylinder", 2)}
SOLIDS |= {CONE: ("cone", 2), PRISM: ("prism", 1)}  # each with the number of its dimensions
MAX_VERTICES = 50_000  # of a mesh
MIN_EDGE_M = 0.001  # of the box around a flat mesh

Form = tuple[str, tuple[float, ...], FloatArray]
"""Shape, size and middle, as of ``PlanningShape``."""


class ArmFrames(Protocol):
    """Frames of ROS, as one arm has them. Each method raises InvalidArgument and NotReady."""

    def in_base(self, frame: str) -> FloatArray:
        """Return the pose (4, 4) of a frame in the base of the arm."""

    def in_tool(self, frame: str) -> FloatArray:
        """Return the pose (4, 4) of a frame in the link of the tool."""

    def tool_in_base(self) -> FloatArray:
        """Return the pose (4, 4) of the link of the tool in the base."""

    def carries(self, link: str) -> bool:
        """Return True where a link is fixed to the link of the tool."""


class PlanningShape(NamedTuple):
    """One shape of an object.

    Attributes:
        shape, size_m: as of ``SceneObject``.
        middle: (4, 4) of its middle, in the frame that the message gives it.
        pose: (4, 4) of that frame in the object.
    """

    shape: str
    size_m: tuple[float, ...]
    middle: FloatArray
    pose: FloatArray


@dataclass(frozen=True, eq=False)
class PlanningObject:
    """An object of the planning scene. Immutable.

    Attributes:
        pose: (4, 4) in the base of the arm or, of an attached object, in the link of the tool.
        shapes: at least one.
        link: link that it is attached to; "" for an object of the world.
        touch_links: links that an attached object may touch.
    """

    pose: FloatArray
    shapes: tuple[PlanningShape, ...]
    link: str = ""
    touch_links: frozenset[str] = frozenset()

    def items(self, name: str) -> Iterator[SceneObject]:
        """Yield its shapes as objects of the scene; of several, ``name/1``, ``name/2``."""
        for number, shape in enumerate(self.shapes, 1):
            yield SceneObject(
                name if len(self.shapes) == 1 else f"{name}/{number}",
                shape.shape,
                shape.size_m,
                self.pose @ shape.pose @ shape.middle,
                attached=bool(self.link),
                in_planning_scene=True,
                touch_links=self.touch_links,
            )


def changed_objects(
    message: Any, known: Mapping[str, PlanningObject], frames: ArmFrames
) -> dict[str, PlanningObject]:
    """Return the objects by id after a message, as MoveIt's PlanningScene applies it.

    Raises InvalidArgument: an object cannot be, or its frame is unknown; NotReady: the arm moves,
    and an object is attached, detached, or in a frame that the arm moves.
    """
    state = message.robot_state
    objects = dict(known) if message.is_diff else {}
    if not state.is_diff:
        objects = {name: one for name, one in objects.items() if not one.link}
    for attached in state.attached_collision_objects:
        with _named(attached.object.id):
            _change_attached(objects, attached, frames)
    for item in message.world.collision_objects:
        with _named(item.id):
            _change(objects, item, frames)
    return objects


@contextmanager
def _named(name: str) -> Iterator[None]:
    try:
        yield
    except InvalidArgument as error:
        raise InvalidArgument(f"{name or 'object without id'}: {error}") from None


def _change(objects: dict[str, PlanningObject], message: Any, frames: ArmFrames) -> None:
    """Apply a CollisionObject."""
    known, operation = objects.get(message.id), _operation(message)
    if operation == REMOVE:
        world = [name for name, one in objects.items() if not one.link]
        for name in [message.id] if message.id else world:
            if name in world:
                del objects[name]
            else:
                log.info("object to remove is not in the planning scene", object=name)
        return
    own_pose, shapes = _pose_and_shapes(message)
    pose = frames.in_base(message.header.frame_id) @ own_pose
    if operation == MOVE:
        if known is None or known.link:
            raise InvalidArgument("no object of the planning scene has this id: cannot move it")
        objects[message.id] = replace(known, pose=pose, shapes=_moved(known.shapes, message))
        return
    if not shapes:
        raise InvalidArgument("has no shape")
    if operation == APPEND and known is not None:
        if known.link:
            raise InvalidArgument(f"is attached to {known.link}: cannot append to it")
        objects[message.id] = replace(known, shapes=known.shapes + shapes)
        return
    objects[message.id] = PlanningObject(pose, shapes)


def _change_attached(objects: dict[str, PlanningObject], message: Any, frames: ArmFrames) -> None:
    """Apply an AttachedCollisionObject."""
    item, link = message.object, message.link_name
    known, operation = objects.get(item.id), _operation(item)
    if operation == MOVE:
        raise InvalidArgument("an attached object cannot be moved: attach it anew")
    if operation == REMOVE:
        for name, one in objects.items():
            if one.link and (name == item.id or (not item.id and link in ("", one.link))):
                objects[name] = PlanningObject(frames.tool_in_base() @ one.pose, one.shapes)
        return
    if not frames.carries(link):  # another arm does
        objects.pop(item.id, None)
        return
    own_pose, shapes = _pose_and_shapes(item)
    touch_links = frozenset(message.touch_links)
    if shapes:
        pose = frames.in_tool(item.header.frame_id) @ own_pose
        if operation == APPEND and known is not None and known.link:
            pose, shapes = known.pose, known.shapes + shapes
    elif known is not None:
        shapes, pose = known.shapes, known.pose
        if not known.link:  # it stays where it is
            pose = inverse_pose(frames.tool_in_base()) @ pose
    else:
        raise InvalidArgument("has no shape, and is not in the planning scene")
    objects[item.id] = PlanningObject(pose, shapes, link, touch_links)


def _operation(message: Any) -> int:
    operation = int.from_bytes(message.operation, "big")  # a byte is bytes in Python
    if operation > MOVE:
        raise InvalidArgument(f"operation is {operation}, must be 0 to {MOVE}")
    return operation


def _pose_and_shapes(message: Any) -> tuple[FloatArray, tuple[PlanningShape, ...]]:
    """Return the pose of an object in its header's frame, and its shapes."""
    parts = [
        *_with_poses("primitives", message.primitives, message.primitive_poses, _solid),
        *_with_poses("meshes", message.meshes, message.mesh_poses, _mesh),
        *_with_poses("planes", message.planes, message.plane_poses, _plane),
    ]
    pose = pose_of_message(message.pose)
    if len(parts) == 1 and np.array_equal(pose, np.eye(4)):  # the pose of its shape is its own
        return parts[0].pose, (parts[0]._replace(pose=np.eye(4)),)
    return pose, tuple(parts)


def _with_poses(
    what: str, shapes: Sequence[Any], poses: Sequence[Any], read: Callable[[Any], Form]
) -> Iterator[PlanningShape]:
    if len(poses) > len(shapes) > 0:
        raise InvalidArgument(f"has {len(poses)} poses of {len(shapes)} {what}")
    for number, shape in enumerate(shapes):
        pose = pose_of_message(poses[number]) if number < len(poses) else np.eye(4)
        yield PlanningShape(*read(shape), pose=pose)


def _moved(shapes: tuple[PlanningShape, ...], message: Any) -> tuple[PlanningShape, ...]:
    """Return the shapes at the poses of a message that moves them; without any, as they are."""
    poses = [*message.primitive_poses, *message.mesh_poses, *message.plane_poses]
    if not poses:
        return shapes
    if len(poses) != len(shapes):
        raise InvalidArgument(f"has {len(poses)} poses to move {len(shapes)} shapes to")
    moved = zip(shapes, poses, strict=True)
    return tuple(shape._replace(pose=pose_of_message(pose)) for shape, pose in moved)


def _solid(message: Any) -> Form:
    """Return shape, size and middle of a SolidPrimitive; of cone and prism, of a body around it."""
    if message.type not in SOLIDS:
        known = ", ".join(f"{number} ({name})" for number, (name, _) in SOLIDS.items())
        raise InvalidArgument(f"primitive has type {message.type} (available: {known})")
    (name, count), sizes = SOLIDS[message.type], tuple(map(float, message.dimensions))
    if len(sizes) != count:
        raise InvalidArgument(f"primitive has {len(sizes)} dimensions, a {name} has {count}")
    if message.type in (CYLINDER, CONE):
        height, radius = sizes
        return "cylinder", (radius, height), np.eye(4)
    if message.type == PRISM:
        corners = np.array([(point.x, point.y) for point in message.polygon.points], np.float64)
        if len(corners) < 3:
            raise InvalidArgument(f"prism has {len(corners)} corners, at least 3 are needed")
        half = 0.5 * sizes[0]
        bottom, top = (np.insert(corners, 2, height, axis=1) for height in (-half, half))
        return _box_around(np.concatenate([bottom, top]))
    return name, sizes, np.eye(4)


def _mesh(message: Any) -> Form:
    if not 0 < len(message.vertices) <= MAX_VERTICES:
        count = len(message.vertices)
        raise InvalidArgument(f"mesh has {count} vertices, must have 1 to {MAX_VERTICES}")
    if not message.triangles:  # MoveIt makes no shape of it
        raise InvalidArgument("mesh has no triangles")
    return _box_around(np.array([(point.x, point.y, point.z) for point in message.vertices]))


def _box_around(points: FloatArray) -> Form:
    """Return the box around points (k, 3), along their axes."""
    if not np.isfinite(points).all():
        raise InvalidArgument("a vertex is not finite")
    low, high = points.min(axis=0), points.max(axis=0)
    size = np.maximum(high - low, MIN_EDGE_M)
    return "box", tuple(size.tolist()), pose_of((0.5 * (low + high)).tolist())


def _plane(message: Any) -> Form:
    """Return a plane a, b, c, d: z of its middle is along (a, b, c), at the distance -d."""
    *numbers, offset = map(float, message.coef)
    normal = np.array(numbers)
    length = float(np.linalg.norm(normal))
    if not (math.isfinite(length) and math.isfinite(offset) and length > 0.0):
        raise InvalidArgument(f"plane has coefficients {[*numbers, offset]}: no direction")
    normal /= length
    middle = -offset / length * normal
    return PLANE, (), pose_along(middle - normal, middle + normal)
