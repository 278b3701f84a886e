"""Poses of a running robot, as a client sees them."""

from __future__ import annotations

from typing import Any

from robotd_msgs.msg import SavedPoses
from robotd_msgs.srv import DeletePose, PlanPose, RenamePose, SavePose

from robotd_ros.client.ros_client import RosClient
from robotd_ros.qos import LATCHED

TOPIC = "robotd/poses"


def poses_of(client: RosClient) -> dict[str, Any]:
    """Return positions (``joints``) and ``problem`` of each pose. Raises DeviceTimeout."""
    with client.listen(SavedPoses, TOPIC, LATCHED) as messages:
        poses = messages.wait().poses
    return {pose.name: {"joints": _by_joint(pose), "problem": pose.problem} for pose in poses}


def save(client: RosClient, name: str, group: str, *, replace: bool) -> str:
    """Save where the joints are; return the positions as text. Raises the errors of ``call``."""
    return _answer(client, SavePose, "save", name=name, group=group, replace=replace)


def rename(client: RosClient, name: str, new_name: str) -> str:
    """Give a pose another name. Raises the errors of ``call``."""
    return _answer(client, RenamePose, "rename", name=name, new_name=new_name)


def delete(client: RosClient, name: str) -> str:
    """Delete a pose. Raises the errors of ``call``."""
    return _answer(client, DeletePose, "delete", name=name)


def plan(client: RosClient, name: str, speed: float) -> tuple[dict[str, float], float]:
    """Return positions and duration, seconds, of a goal to a pose. Raises the errors of ``call``.

    ``speed``: part of the limits of the joints, 0.01 to 1.
    """
    response = client.call(PlanPose, f"{TOPIC}/plan", name=name, speed=speed)
    return _by_joint(response), response.duration_s


def _by_joint(message: Any) -> dict[str, float]:
    return dict(zip(message.joints, message.positions, strict=True))


def _answer(client: RosClient, service_type: Any, service: str, **request: Any) -> str:
    return str(client.call(service_type, f"{TOPIC}/{service}", **request).message)
