"""Services, topics and the actions of tool space on the node ``robotd``."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

from robotd.api import FloatArray, Unsupported
from robotd.api.models import transform_numbers
from robotd_ros.nodes.latched_topics import publish_if_alive
from robotd_ros.nodes.tool_pose_topic import fill_transform
from robotd_ros.qos import LATCHED
from robotd_ros.run_nodes import NodeContext
from robotd_tool_space.nodes.scene_services import SceneServices
from robotd_tool_space.nodes.sequence_services import MoveSequenceAction
from robotd_tool_space.nodes.tf_frames import TfFrames
from robotd_tool_space.nodes.tool_services import MoveToolAction, ToolServices
from robotd_tool_space.settings import ToolSpaceKeys
from robotd_tool_space.tool_groups import ToolGroups

FRAMES_TOPIC = "~/tool_frames"
STATIC_TOPIC = "/tf_static"


@contextmanager
def add_tool_nodes(context: NodeContext, tools: ToolGroups) -> Iterator[None]:
    """Add services, topics and the actions."""
    frames = FrameTopics(context, tools)
    source = TfFrames(context)
    for tool in tools.values():
        tool.frame_source = source
    ToolServices(context, tools)
    MoveToolAction(context, tools)
    MoveSequenceAction(context, tools)
    SceneServices(context, tools)
    _add_planning_scene(context, tools, source)
    frames.publish()
    yield


def _add_planning_scene(context: NodeContext, tools: ToolGroups, source: TfFrames) -> None:
    """Add the topic of MoveIt's planning scene, where the robot's file names it."""
    descriptor = context.robot.descriptor
    settings = descriptor.settings(ToolSpaceKeys).tool_space.collisions
    if settings is None or settings.planning_scene_topic is None or descriptor.urdf is None:
        return
    try:
        from robotd_tool_space.nodes.planning_scene_topic import PlanningSceneTopic
    except ImportError as error:
        text = (
            "planning_scene_topic needs the messages of MoveIt: apt install ros-jazzy-moveit-msgs"
        )
        raise Unsupported(f"tool_space.collisions.{text} ({error})") from None
    PlanningSceneTopic(context, tools, source, descriptor.urdf, settings.planning_scene_topic)


class FrameTopics:
    """Frames of the robot's file as static transforms, the chosen ones on a topic.

    Any thread may call ``publish``, as each choice of a tool does.
    """

    def __init__(self, context: NodeContext, tools: ToolGroups) -> None:
        self._tools, node = tools, context.operator
        self._clock, self._prefix = node.get_clock(), node.get_parameter("frame_prefix").value
        self._chosen = node.create_publisher(TFMessage, FRAMES_TOPIC, LATCHED)
        self._static = node.create_publisher(TFMessage, STATIC_TOPIC, LATCHED)
        named = [
            self._transform(parent, name, pose)
            for tool in tools.values()
            for parent, name, pose in tool.named_frames()
        ]
        if named:
            self._static.publish(TFMessage(transforms=named))
        for tool in tools.values():
            tool.on_change = self.publish

    def publish(self) -> None:
        """Publish the tool and the work frame in force, of each group."""
        chosen = [
            self._transform(parent, name, pose)
            for tool in self._tools.values()
            for parent, name, pose in tool.chosen_frames()
        ]
        publish_if_alive(self._chosen, TFMessage(transforms=chosen))

    def _transform(self, parent: str, name: str, pose: FloatArray) -> TransformStamped:
        message = TransformStamped(child_frame_id=self._prefix + name)
        message.header.frame_id = self._prefix + parent
        message.header.stamp = self._clock.now().to_msg()
        fill_transform(message, transform_numbers(pose))
        return message
