"""Services and topic of the poses on the node ``robotd``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from robotd_msgs.msg import SavedPose, SavedPoses
from robotd_msgs.srv import DeletePose, PlanPose, RenamePose, SavePose

from robotd.api import RobotdError, get_logger
from robotd_ros.nodes.latched_topics import publish_if_alive
from robotd_ros.qos import LATCHED
from robotd_ros.run_nodes import NodeContext
from robotd_ros.services import add_service
from robotd_shared.pose_file import SavedToolPose
from robotd_teach.poses import SPEED, Poses
from robotd_teach.tool_poses import matrix_of
from robotd_tool_space.geometry.rotations import fill_pose

POSES = "~/poses"
log = get_logger("teach")


@contextmanager
def add_pose_services(context: NodeContext, poses: Poses) -> Iterator[None]:
    """Add services and topic."""
    node, host = context.operator, context.host
    topic = node.create_publisher(SavedPoses, POSES, LATCHED)

    def publish() -> None:
        try:
            found, problems, tools = poses.all(), poses.problems(), poses.tool_poses()
        except RobotdError as error:
            log.warning("the poses cannot be read", reason=str(error))
            found, problems, tools = {}, {}, {}
        saved = [
            _message(name, joints, problems.get(name, ""), tools.get(name))
            for name, joints in found.items()
        ]
        publish_if_alive(topic, SavedPoses(poses=saved))

    def save(request: Any, response: Any) -> str:
        joints = poses.save(request.name, request.group, replace=request.replace)
        return ", ".join(f"{joint} {position:+z.3f}" for joint, position in joints.items())

    def rename(request: Any, response: Any) -> str:
        poses.rename(request.name, request.new_name)
        return f"{request.name} is called {request.new_name} now"

    def delete(request: Any, response: Any) -> str:
        poses.delete(request.name)
        return f"{request.name} is deleted"

    def plan(request: Any, response: Any) -> str:
        _, goal = poses.plan(request.name, request.speed or SPEED)
        response.duration_s = float(goal.times_s[-1])
        response.joints, response.positions = [*goal.joint_names], goal.positions[-1].tolist()
        return f"{request.name} takes {response.duration_s:.1f} s"

    for service_type, name, handle in (
        (SavePose, "save", save),
        (RenamePose, "rename", rename),
        (DeletePose, "delete", delete),
        (PlanPose, "plan", plan),
    ):
        add_service(node, host, service_type, f"{POSES}/{name}", handle)
    poses.on_change = publish
    publish()
    yield


def _message(
    name: str, joints: Mapping[str, float], problem: str, tool_pose: SavedToolPose | None
) -> SavedPose:
    message = SavedPose(name=name, joints=[*joints], positions=[*joints.values()], problem=problem)
    if tool_pose is not None:
        message.has_tool_pose = True
        message.tool, message.work_frame = tool_pose.tool, tool_pose.work_frame
        fill_pose(message.tool_pose, matrix_of(tool_pose))
    return message
