"""Bodies around an arm, or carried by its tool: boxes, cylinders, spheres and planes."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from robotd.api import FloatArray, InvalidArgument, did_you_mean
from robotd_tool_space.collision.bodies import Body, pose_along
from robotd_tool_space.geometry.rotations import checked_pose, pose_of
from robotd_tool_space.settings import CollisionSettings

PLANE = "plane"
SIZES = {"box": 3, "cylinder": 2, "sphere": 1, PLANE: 0}  # numbers that make a size
MAX_SIZE_M = 100.0
MAX_NAME = 64


@dataclass(frozen=True, eq=False)
class SceneObject:
    """One body. Immutable; any thread.

    Attributes:
        name: unique in the scene.
        shape: ``box``, ``cylinder``, ``sphere`` or ``plane``.
        size_m: edges of a box; radius and length of a cylinder, along z; radius of a sphere;
            nothing of a plane, whose z points to where the arm may be.
        pose: (4, 4) of its middle: in the base of the arm, or in the link of the tool.
        attached: the tool carries it.
        in_file: the file of the robot has it.
        in_planning_scene: MoveIt's planning scene has it.
        touch_links: links that it may touch while the tool carries it.
    """

    name: str
    shape: str
    size_m: tuple[float, ...]
    pose: FloatArray
    attached: bool = False
    in_file: bool = False
    in_planning_scene: bool = False
    touch_links: frozenset[str] = frozenset()

    def checked(self) -> SceneObject:
        """Return it with its pose as an array. Raises InvalidArgument: what is wrong with it."""
        if not 0 < len(self.name) <= MAX_NAME:
            raise InvalidArgument(f"name {self.name!r}: must have 1 to {MAX_NAME} characters")
        count = SIZES.get(self.shape)
        if count is None:
            known = f"available: {', '.join(SIZES)}"
            hint = did_you_mean(self.shape, SIZES)
            raise InvalidArgument(f"{self.name}: no shape {self.shape!r} ({known}){hint}")
        if len(self.size_m) != count:
            text = f"a {self.shape} has {count}"
            raise InvalidArgument(f"{self.name}: size_m has {len(self.size_m)} numbers, {text}")
        for size in self.size_m:
            if not (math.isfinite(size) and 0.0 < size <= MAX_SIZE_M):
                text = f"must be above 0, to {MAX_SIZE_M:g}"
                raise InvalidArgument(f"{self.name}: size_m has {size:g}, {text}")
        if self.attached and self.shape == PLANE:
            raise InvalidArgument(f"{self.name}: a tool cannot carry a plane")
        return replace(self, pose=checked_pose(self.pose, f"pose of {self.name}"))

    @property
    def body(self) -> Body:
        """Collision body, for all shapes but a plane."""
        match self.shape:
            case "box":
                return Body(self.pose, 0.5 * np.array(self.size_m))
            case "cylinder":
                radius, length = self.size_m
                return Body(self.pose, np.array([0.0, 0.0, 0.5 * length]), disc_m=radius)
            case _:
                return Body(self.pose, np.zeros(3), ball_m=self.size_m[0])


def file_objects(settings: CollisionSettings) -> list[SceneObject]:
    """Return the bodies of a robot's file."""
    found: list[tuple[str, str, tuple[float, ...], FloatArray]] = []
    for name, plane in settings.planes.items():
        normal = np.array(plane.normal) / np.linalg.norm(plane.normal)
        middle = plane.distance_m * normal
        found.append((name, PLANE, (), pose_along(middle - normal, middle + normal)))
    found += [(name, "box", box.size_m, box.pose) for name, box in settings.boxes.items()]
    for name, cylinder in settings.cylinders.items():
        size_m = cylinder.radius_m, cylinder.length_m
        found.append((name, "cylinder", size_m, cylinder.pose))
    for name, ball in settings.spheres.items():
        found.append((name, "sphere", (ball.radius_m,), pose_of(ball.xyz_m)))
    return [SceneObject(*values, in_file=True) for values in found]
