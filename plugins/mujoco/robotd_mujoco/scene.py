"""Surroundings of the robot: a scene in YAML, or in MJCF."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

import mujoco
import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from robotd.api import (
    DescriptorError,
    FloatArray,
    Shape,
    WorldCamera,
    WorldObject,
    read_yaml,
    unknown_name,
    validate,
)

FLOOR = "floor"
PREFIX = "scene/"  # of all names of a scene in MJCF

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Point = tuple[Finite, Finite, Finite]
Share = Annotated[float, Field(ge=0, le=1)]


class _Keys(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class SceneObject(_Keys):
    """One object of one shape, fixed or with a mass."""

    name: str = Field(min_length=1)
    box_m: tuple[Positive, Positive, Positive] | None = None
    cylinder_m: tuple[Positive, Positive] | None = None  # radius, length
    sphere_m: Positive | None = None  # radius
    mesh: str | None = None  # file beside the scene, STL or OBJ
    scale: Positive = 1.0  # of the mesh
    at_m: Point
    rpy_rad: Point = (0.0, 0.0, 0.0)
    mass_kg: Positive | None = None  # None: it is fixed
    friction: Positive = 1.0
    color: tuple[Share, Share, Share, Share] = (0.6, 0.6, 0.6, 1.0)

    @model_validator(mode="after")
    def _check_shape(self) -> SceneObject:
        shapes = [self.box_m, self.cylinder_m, self.sphere_m, self.mesh]
        if sum(shape is not None for shape in shapes) != 1:
            raise ValueError("needs one of box_m, cylinder_m, sphere_m and mesh")
        return self


class SceneCamera(_Keys):
    """One camera, in the scene or on a link of the robot."""

    name: str = Field(min_length=1)
    at_m: Point
    look_at_m: Point
    link: str | None = None  # what the points refer to; None: the scene
    width: int = Field(320, ge=16, le=1920)
    height: int = Field(240, ge=16, le=1080)
    fov_deg: float = Field(50.0, gt=1, lt=170)  # vertical
    rate_hz: float = Field(10.0, gt=0, le=100)

    @model_validator(mode="after")
    def _check_direction(self) -> SceneCamera:
        if self.at_m == self.look_at_m:
            raise ValueError("at_m and look_at_m are the same point")
        return self


class Scene(_Keys):
    """Content of a scene file."""

    floor: bool = True
    objects: tuple[SceneObject, ...] = ()
    cameras: tuple[SceneCamera, ...] = ()

    @model_validator(mode="after")
    def _check_names(self) -> Scene:
        names = [*(item.name for item in self.objects), *(camera.name for camera in self.cameras)]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"names are used twice: {', '.join(twice)}")
        return self


def load_scene(path: Path, links: Sequence[str]) -> Scene:
    """Read a scene in YAML for a robot with ``links``.

    Raises DescriptorError with every problem, its line and its key.
    """
    tree = read_yaml(path)
    scene = validate(Scene, tree.plain(), tree)
    problems: list[DescriptorError] = []

    def add(what: str, *keys: str | int) -> None:
        line, key = tree.find(keys).line, ".".join(map(str, keys))
        problems.append(DescriptorError(what, path=path, line=line, key=key))

    taken = {*links, "world", *([FLOOR] if scene.floor else [])}
    for number, thing in enumerate(scene.objects):
        place = ("objects", number)
        if thing.name in taken:
            what = f"a link, the floor or the world has this name (value {thing.name!r})"
            add(what, *place, "name")
        if thing.mesh is not None and not (path.parent / thing.mesh).is_file():
            add(f"the file does not exist (value {thing.mesh!r})", *place, "mesh")
    bodies = ["world", *links, *(thing.name for thing in scene.objects)]
    for number, camera in enumerate(scene.cameras):
        if camera.link is not None and camera.link not in bodies:
            add(unknown_name("link", camera.link, bodies), "cameras", number, "link")
    if problems:
        raise DescriptorError.join(problems)
    return scene


def add_objects(spec: mujoco.MjSpec, scene: Scene, folder: Path) -> None:
    """Add the objects of a scene to the robot's model."""
    world = spec.worldbody
    world.add_light(pos=[0.5, -0.5, 2.0], dir=[-0.2, 0.2, -1.0], castshadow=False)
    if scene.floor:
        world.add_geom(
            name=FLOOR,
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            size=[5.0, 5.0, 0.1],
            rgba=[0.82, 0.84, 0.86, 1.0],
        )
    for item in scene.objects:
        body = world.add_body(name=item.name, pos=item.at_m, quat=_quaternion(item.rpy_rad))
        geom = body.add_geom(
            name=item.name, rgba=item.color, friction=[item.friction, 0.005, 0.0001], condim=4
        )
        _set_shape(spec, geom, item, folder)
        if item.mass_kg is not None:
            geom.mass = item.mass_kg
            body.add_freejoint()


def add_cameras(spec: mujoco.MjSpec, cameras: tuple[SceneCamera, ...]) -> None:
    """Add cameras to a whole model."""
    for camera in cameras:
        body = spec.worldbody if camera.link is None else spec.body(camera.link)
        body.add_camera(
            name=camera.name,
            pos=camera.at_m,
            quat=_view(np.array(camera.look_at_m) - np.array(camera.at_m)),
            fovy=camera.fov_deg,
        )


def describe_cameras(cameras: tuple[SceneCamera, ...]) -> list[WorldCamera]:
    """Return what a client has to know of the cameras."""
    return [
        WorldCamera(
            camera.name,
            camera.width,
            camera.height,
            0.5 * camera.height / math.tan(0.5 * math.radians(camera.fov_deg)),
            camera.rate_hz,
        )
        for camera in cameras
    ]


def describe_objects(spec: mujoco.MjSpec, links: Sequence[str]) -> list[WorldObject]:
    """Return the objects: bodies that are not links, by their first geometry."""
    shapes: dict[Any, tuple[Shape, Callable[[FloatArray], tuple[float, ...]]]] = {
        mujoco.mjtGeom.mjGEOM_BOX: (Shape.BOX, lambda size: tuple(2.0 * size)),
        mujoco.mjtGeom.mjGEOM_CYLINDER: (Shape.CYLINDER, lambda size: (size[0], 2.0 * size[1])),
        mujoco.mjtGeom.mjGEOM_SPHERE: (Shape.SPHERE, lambda size: (size[0],)),
        mujoco.mjtGeom.mjGEOM_MESH: (Shape.MESH, lambda size: (1.0, 1.0, 1.0)),
    }
    found = []
    for body in spec.worldbody.bodies:
        geom = next(iter(body.geoms), None)
        if body.name in links or geom is None or geom.type not in shapes:
            continue
        if not body.name:
            raise DescriptorError("a body of the scene has no name, which its frame needs")
        shape, size_of = shapes[geom.type]
        mesh = spec.mesh(geom.meshname) if shape is Shape.MESH else None
        size = tuple(map(float, mesh.scale if mesh else size_of(geom.size)))
        red, green, blue, opacity = map(float, geom.rgba)
        color = red, green, blue, opacity
        file = Path(mesh.file) if mesh else None
        moves = any(joint.type == mujoco.mjtJoint.mjJNT_FREE for joint in body.joints)
        found.append(WorldObject(body.name.removeprefix(PREFIX), shape, size, color, moves, file))
    return found


def _set_shape(spec: mujoco.MjSpec, geom: mujoco.MjsGeom, item: SceneObject, folder: Path) -> None:
    if item.box_m is not None:
        geom.type, geom.size = mujoco.mjtGeom.mjGEOM_BOX, [0.5 * edge for edge in item.box_m]
    elif item.cylinder_m is not None:
        radius, length = item.cylinder_m
        geom.type, geom.size = mujoco.mjtGeom.mjGEOM_CYLINDER, [radius, 0.5 * length, 0.0]
    elif item.sphere_m is not None:
        geom.type, geom.size = mujoco.mjtGeom.mjGEOM_SPHERE, [item.sphere_m, 0.0, 0.0]
    else:
        file = folder / str(item.mesh)
        spec.add_mesh(name=item.name, file=str(file.resolve()), scale=[item.scale] * 3)
        geom.type, geom.meshname = mujoco.mjtGeom.mjGEOM_MESH, item.name


def _quaternion(rpy: Point) -> np.ndarray:
    quaternion = np.zeros(4)
    mujoco.mju_euler2Quat(quaternion, np.array(rpy), "XYZ")  # about fixed axes, as in a URDF
    return quaternion


def _view(direction: np.ndarray) -> np.ndarray:
    """Return the orientation of a camera, which looks along its -z, with its x level."""
    back = -direction / np.linalg.norm(direction)
    level = np.cross([0.0, 0.0, 1.0], back)
    if np.linalg.norm(level) < 1e-6:  # straight up or down
        level = np.array([0.0, -1.0, 0.0])
    right = level / np.linalg.norm(level)
    matrix = np.column_stack([right, np.cross(back, right), back])
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, matrix.ravel())
    return quaternion
