"""Service and topic of the scene, which need the interfaces ``robotd_msgs``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from robotd_msgs.msg import Scene as SceneMessage
from robotd_msgs.msg import SceneObject as ObjectMessage
from robotd_msgs.srv import ChangeScene

from robotd.api import FloatArray, InvalidArgument, Unsupported
from robotd_ros.nodes.latched_topics import publish_if_alive
from robotd_ros.qos import LATCHED
from robotd_ros.run_nodes import NodeContext
from robotd_ros.services import add_service
from robotd_tool_space.collision.scene import Scene
from robotd_tool_space.collision.scene_object import SceneObject
from robotd_tool_space.geometry.rotations import fill_pose, pose_of_message
from robotd_tool_space.tool_groups import ToolGroups

_REQUEST = ChangeScene.Request


class SceneServices:
    """Service ``change_scene`` and topic ``scene``. Any worker thread."""

    def __init__(self, context: NodeContext, tools: ToolGroups) -> None:
        self._tools, node = tools, context.operator
        self._topic = node.create_publisher(SceneMessage, "~/scene", LATCHED)
        add_service(node, context.host, ChangeScene, "~/change_scene", self._change)
        for tool in tools.values():
            if tool.scene is not None:
                tool.scene.listeners.append(self._publish)
        self._publish()

    def _change(self, request: Any, response: Any) -> str:
        return change_scene(self._scene(request.object.group), request)

    def _scene(self, group: str) -> Scene:
        scene = self._tools.of(group).scene
        if scene is None:
            text = "a scene: the robot's file has no tool_space.collisions, and nothing is checked"
            raise Unsupported(text)
        return scene

    def _publish(self) -> None:
        message = SceneMessage(
            objects=[
                _object_message(group, item)
                for group, tool in self._tools.items()
                if tool.scene is not None
                for item in tool.scene.objects
            ]
        )
        publish_if_alive(self._topic, message)


def change_scene(scene: Scene, request: Any) -> str:
    """Execute a request of the service; return its message. Raises InvalidArgument, NotReady."""
    item = request.object
    changes: dict[int, Callable[[], str]] = {
        _REQUEST.ADD: lambda: scene.add(_object_of(item)),
        _REQUEST.REMOVE: lambda: scene.remove(item.name),
        _REQUEST.MOVE: lambda: scene.move(item.name, _pose_of(item)),
        _REQUEST.ATTACH: lambda: scene.attach(item.name),
        _REQUEST.DETACH: lambda: scene.detach(item.name),
    }
    if request.operation not in changes:
        raise InvalidArgument(f"operation is {request.operation}, must be 0 to {max(changes)}")
    return changes[request.operation]()


def _object_of(message: Any) -> SceneObject:
    pose = _pose_of(message)
    return SceneObject(
        message.name, message.shape, tuple(message.size_m), pose, attached=message.attached
    )


def _pose_of(message: Any) -> FloatArray:
    return pose_of_message(message.pose)


def _object_message(group: str, item: SceneObject) -> Any:
    message = ObjectMessage(
        group=group,
        name=item.name,
        shape=item.shape,
        size_m=list(item.size_m),
        attached=item.attached,
        in_file=item.in_file,
    )
    fill_pose(message.pose, item.pose)
    return message
