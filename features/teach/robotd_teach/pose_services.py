"""Services and topic of the poses on the node ``robotd``."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from robotd_msgs.msg import SavedPose, SavedPoses
from robotd_msgs.srv import DeletePose, PlanPose, RenamePose, SavePose

from robotd.api import RobotdError, get_logger
from robotd_ros.nodes.latched_topics import publish_if_alive
from robotd_ros.qos import LATCHED
from robotd_ros.run_nodes import NodeContext
from robotd_ros.services import add_service
from robotd_teach.poses import SPEED, Poses

POSES = "~/poses"
log = get_logger("teach")


@contextmanager
def add_pose_services(context: NodeContext, poses: Poses) -> Iterator[None]:
    """Add services and topic."""
    node, host = context.operator, context.host
    topic = node.create_publisher(SavedPoses, POSES, LATCHED)

    def publish() -> None:
        try:
            found = poses.all()
        except RobotdError as error:
            log.warning("the poses cannot be read", reason=str(error))
            found = {}
        saved = [
            SavedPose(
                name=name,
                joints=[*joints],
                positions=[*joints.values()],
                problem=poses.problem(joints),
            )
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
        joints = poses.known(request.name)
        response.duration_s = poses.duration_s(joints, request.speed or SPEED)
        response.joints, response.positions = [*joints], [*joints.values()]
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
