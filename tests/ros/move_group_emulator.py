"""Emulator of the planning scene of MoveIt's ``move_group``, ROS 2 Jazzy, without MoveIt.

After its sources: ``MoveGroupGetPlanningSceneService`` answers with
``PlanningScene::getPlanningSceneMsg`` of the requested components, which is no difference;
``PlanningSceneMonitor::scenePublishingThread`` publishes a difference after each change, with the
whole of each object that has changed.

Not modeled: planning and execution, the other services and topics, frames (objects keep those
that they were given), octomaps, the collision matrix, repeated messages of the robot's state, and
the first message of the topic, the whole scene, which is mostly sent before discovery.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable
from typing import Any, Self

import rclpy
from moveit_msgs.msg import (
    AttachedCollisionObject,
    CollisionObject,
    PlanningScene,
    PlanningSceneComponents,
)
from moveit_msgs.srv import GetPlanningScene

from robotd_ros.host import RosHost

PUBLISHER_DEPTH = 100


class MoveGroup:
    """Node ``move_group`` of a domain, until the end of its block.

    Attributes:
        answering: cleared, responses are computed and held back until it is set.
        requests: number of them.
    """

    def __init__(
        self,
        domain: int,
        objects: Iterable[CollisionObject] = (),
        attached: Iterable[AttachedCollisionObject] = (),
        topic: str = "monitored_planning_scene",
    ) -> None:
        self._objects = {item.id: item for item in objects}
        self._attached = list(attached)
        self._lock = threading.Lock()
        self.answering, self.requests = threading.Event(), 0
        self.answering.set()
        self._host = RosHost(domain_id=domain)
        self._host.start()
        node = rclpy.create_node("move_group", context=self._host.context)
        self._publisher = node.create_publisher(PlanningScene, topic, PUBLISHER_DEPTH)
        node.create_service(GetPlanningScene, "get_planning_scene", self._answer)
        self._host.add_node(node)

    def change(self, *added: CollisionObject, removed: Iterable[str] = ()) -> None:
        """Change the scene, and publish the difference."""
        message = PlanningScene(is_diff=True)
        message.robot_state.is_diff = True
        with self._lock:
            for name in removed:
                del self._objects[name]
                gone = CollisionObject(id=name, operation=CollisionObject.REMOVE)
                message.world.collision_objects.append(gone)
            for item in added:
                self._objects[item.id] = item
                message.world.collision_objects.append(item)
        self._publisher.publish(message)

    def _answer(self, request: Any, response: Any) -> Any:
        components = request.components.components
        scene = response.scene
        with self._lock:
            if components & PlanningSceneComponents.ROBOT_STATE_ATTACHED_OBJECTS:
                scene.robot_state.attached_collision_objects = list(self._attached)
            if components & PlanningSceneComponents.WORLD_OBJECT_GEOMETRY:
                scene.world.collision_objects = list(self._objects.values())
            elif components & PlanningSceneComponents.WORLD_OBJECT_NAMES:
                scene.world.collision_objects = [CollisionObject(id=name) for name in self._objects]
        self.requests += 1
        self.answering.wait()
        return response

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.answering.set()
        self._host.close()
