"""Poses of a running robot, as a client sees them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robotd_msgs.msg import SavedPose, SavedPoses
from robotd_msgs.srv import ComputeFk, DeletePose, PlanPose, RenamePose, SavePose
from sensor_msgs.msg import JointState

from robotd_ros.client.ros_client import RosClient
from robotd_ros.commands.tool_move import components_of
from robotd_ros.qos import LATCHED

TOPIC = "robotd/poses"


def poses_of(client: RosClient) -> dict[str, Any]:
    """Return positions (``joints``), ``tool`` and ``problem`` of each pose. Raises DeviceTimeout.

    ``tool``: x, y, z, roll, pitch, yaw, m and rad, with ``tool`` and ``work_frame``; None: not
    saved.
    """
    with client.listen(SavedPoses, TOPIC, LATCHED) as messages:
        poses = messages.wait().poses
    return {
        pose.name: {
            "joints": _by_joint(pose),
            "tool": _tool_pose(pose) if pose.has_tool_pose else None,
            "problem": pose.problem,
        }
        for pose in poses
    }


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


def tool_pose_at(client: RosClient, joints: Mapping[str, float], group: str = "") -> Any:
    """Return the geometry_msgs/Pose of the chosen tool at positions, in the chosen work frame.

    ``group``: joint group; "": the only one. Raises the errors of ``call``.
    """
    state = JointState(name=[*joints], position=[*joints.values()])
    request = {"group": group, "joint_state": state}
    return client.call(ComputeFk, "robotd/compute_fk", **request).pose_stamped.pose


def _tool_pose(pose: SavedPose) -> dict[str, Any]:
    names = {"tool": pose.tool, "work_frame": pose.work_frame}
    return {**components_of(pose.tool_pose), **names}


def _by_joint(message: Any) -> dict[str, float]:
    return dict(zip(message.joints, message.positions, strict=True))


def _answer(client: RosClient, service_type: Any, service: str, **request: Any) -> str:
    return str(client.call(service_type, f"{TOPIC}/{service}", **request).message)
