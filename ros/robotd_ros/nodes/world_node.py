"""robotd_world: objects around a simulated robot, as transforms, and services that move them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import TransformStamped
from rclpy.node import Node
from robotd_msgs.msg import WorldObject as ObjectMessage
from robotd_msgs.msg import WorldObjects
from robotd_msgs.srv import PlaceObject
from std_msgs.msg import ColorRGBA
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

from robotd.descriptor.urdf import transform_numbers
from robotd.descriptor.urdf.urdf_model import frame
from robotd.device.process_image import ProcessImage
from robotd.device.world import World, WorldObject
from robotd.errors import InvalidArgument
from robotd.robot import Robot
from robotd_ros.host import RosHost
from robotd_ros.node_names import WORLD_NODE
from robotd_ros.nodes.hot_topics import HotTopics
from robotd_ros.qos import LATCHED
from robotd_ros.services import add_service

RATE_HZ = 25.0
TF_DEPTH = 100
MAX_COORDINATE = 100.0  # m or rad


class WorldNode(Node):
    """Publishes where the objects are; ``~/place`` and ``~/reset`` move them.

    Args:
        robot: on a backend with a world.
        host: whose workers answer.
    """

    def __init__(self, robot: Robot, world: World, host: RosHost) -> None:
        super().__init__(WORLD_NODE, context=host.context)
        self._world = world
        objects = world.objects
        add_service(self, host, Trigger, "~/reset", self._reset)
        add_service(self, host, PlaceObject, "~/place", self._place)
        self.create_publisher(WorldObjects, "~/objects", LATCHED).publish(
            WorldObjects(frame_id=world.frame, objects=[*map(_object_message, objects)])
        )
        if not objects:
            return
        poses = _ObjectPoses(self, robot, world)
        rate_hz = min(RATE_HZ, robot.descriptor.cycle.rate_hz)
        robot.control_loop.every(rate_hz, "objects", poses.publish)
        self.rates_hz = dict.fromkeys(poses.topics, rate_hz)

    def _reset(self, request: Any, response: Any) -> str:
        self._world.reset()
        return f"{len(self._world.objects)} objects are where they were at the start"

    def _place(self, request: Any, response: Any) -> str:
        """Move one object; NaN coordinates, and empty fields, stay as they are."""
        name, names = request.name, [item.name for item in self._world.objects]
        if name not in names:
            raise InvalidArgument(f"object {name!r} is unknown (available: {', '.join(names)})")
        pose = self._world.poses()[names.index(name)].copy()
        if position := _three_numbers("position", request.position):
            pose[:3] = np.where(np.isnan(position), pose[:3], position)
        if rpy := _three_numbers("rpy", request.rpy):
            if np.isnan(rpy).any():
                raise InvalidArgument(f"rpy: {rpy} needs all three angles")
            pose[3:] = transform_numbers(frame(np.zeros(3), np.array(rpy)))[3:]
        self._world.place(name, pose)
        return f"{name} is at x={pose[0]:g} y={pose[1]:g} z={pose[2]:g}"


class _ObjectPoses(HotTopics):
    """Transforms of the objects."""

    def __init__(self, node: Node, robot: Robot, world: World) -> None:
        super().__init__(node, robot)
        self._world = world
        transforms = [TransformStamped(child_frame_id=item.name) for item in world.objects]
        for transform in transforms:
            transform.header.frame_id = world.frame
        paths = [f"transforms.{index}.transform" for index in range(len(transforms))]
        message = self.add("/tf", TF_DEPTH, TFMessage(transforms=transforms), paths)
        self._views = [message.view(path) for path in paths]

    def fill(self, image: ProcessImage) -> bool:
        for view, pose in zip(self._views, self._world.poses(), strict=True):
            view[:] = pose
        return True


def _object_message(item: WorldObject) -> ObjectMessage:
    red, green, blue, opacity = map(float, item.color)
    return ObjectMessage(
        name=item.name,
        shape=str(item.shape),
        size_m=[*item.size_m],
        color=ColorRGBA(r=red, g=green, b=blue, a=opacity),
        moves=item.moves,
        mesh=str(item.mesh or ""),
    )


def _three_numbers(field: str, values: Sequence[float]) -> list[float]:
    """Return the numbers of a field, m or rad; none where it is empty. Raises InvalidArgument."""
    if len(values) not in (0, 3):
        raise InvalidArgument(f"{field}: has {len(values)} numbers; 3 are needed, or none")
    for value in values:
        if abs(value) > MAX_COORDINATE:
            limit = f"-{MAX_COORDINATE:g}..{MAX_COORDINATE:g}"
            raise InvalidArgument(f"{field}: {value:g} is outside {limit}")
    return list(values)
