"""robotd_world: objects around a simulated robot, as transforms, and services that move them."""

from __future__ import annotations

from typing import Any

import numpy as np
from geometry_msgs.msg import TransformStamped
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.node import Node
from robotd_msgs.msg import WorldObject as ObjectMessage
from robotd_msgs.msg import WorldObjects
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
from robotd_ros.node_registry import WORLD_NODE
from robotd_ros.nodes.hot_topics import HotTopics
from robotd_ros.qos import LATCHED
from robotd_ros.services import add_service, named_values

RATE_HZ = 25.0
TF_DEPTH = 100
PLACE_KEYS = ("x", "y", "z", "roll", "pitch", "yaw")
MAX_DISTANCE_M = 100.0


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
        add_service(self, host, SetParametersAtomically, "~/place", named_values(self._place))
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

    def _place(self, fields: dict[str, Any]) -> str:
        """Move one object; coordinates that are not named stay as they are."""
        name = fields.pop("name", None)
        names = [item.name for item in self._world.objects]
        if name not in names:
            raise InvalidArgument(f"object {name!r} is unknown (available: {', '.join(names)})")
        if unknown := [key for key in fields if key not in PLACE_KEYS]:
            known = ", ".join(PLACE_KEYS)
            raise InvalidArgument(f"{unknown[0]} is unknown (available: {known})")
        values = {key: _coordinate(key, value) for key, value in fields.items()}
        pose = self._world.poses()[names.index(name)].copy()
        for index, key in enumerate(("x", "y", "z")):
            pose[index] = values.get(key, pose[index])
        if any(key in values for key in PLACE_KEYS[3:]):
            turned = frame(np.zeros(3), np.array([values.get(key, 0.0) for key in PLACE_KEYS[3:]]))
            pose[3:] = transform_numbers(turned)[3:]
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


def _coordinate(key: str, value: Any) -> float:
    """Return a number of m or rad. Raises InvalidArgument."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InvalidArgument(f"{key}: {value!r} is not a number")
    if not abs(value) <= MAX_DISTANCE_M:
        limit = f"-{MAX_DISTANCE_M:g}..{MAX_DISTANCE_M:g}"
        raise InvalidArgument(f"{key}: {value:g} is outside {limit}")
    return float(value)
