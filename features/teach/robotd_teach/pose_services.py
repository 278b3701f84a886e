"""Services and topic of the poses on the node ``robotd``.

``~/poses`` has all poses as JSON: positions and ``problem`` of each, by name. The services take
values by name (SetParametersAtomically): ``~/poses/save`` ``name``, ``group`` and ``replace``;
``~/poses/rename`` ``name`` and ``new``; ``~/poses/delete`` ``name``; ``~/poses/plan`` ``name`` and
``speed``, whose answer is JSON: ``joints`` and ``seconds`` of a goal that leads there.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from rcl_interfaces.srv import SetParametersAtomically
from std_msgs.msg import String

from robotd.api import RobotdError, get_logger
from robotd_ros.nodes.latched_topics import publish_if_alive
from robotd_ros.qos import LATCHED
from robotd_ros.run_nodes import NodeContext
from robotd_ros.services import add_service, named_values
from robotd_teach.poses import SPEED, Poses
from robotd_teach.request_values import taken

POSES = "~/poses"
log = get_logger("teach")


@contextmanager
def add_pose_services(context: NodeContext, poses: Poses) -> Iterator[None]:
    """Add services and topic."""
    node, host = context.operator, context.host
    topic = node.create_publisher(String, POSES, LATCHED)

    def publish() -> None:
        try:
            found = poses.all()
        except RobotdError as error:
            log.warning("the poses cannot be read", reason=str(error))
            found = {}
        told = {
            name: {"joints": dict(joints), "problem": poses.problem(joints)}
            for name, joints in found.items()
        }
        publish_if_alive(topic, String(data=json.dumps(told)))

    def save(values: dict[str, Any]) -> str:
        given = taken(values, {"name": str}, {"group": str, "replace": bool})
        joints = poses.save(given.pop("name"), given.pop("group", ""), **given)
        return ", ".join(f"{joint} {position:+z.3f}" for joint, position in joints.items())

    def rename(values: dict[str, Any]) -> str:
        given = taken(values, {"name": str, "new": str}, {})
        poses.rename(given["name"], given["new"])
        return f"{given['name']} is called {given['new']} now"

    def delete(values: dict[str, Any]) -> str:
        name = taken(values, {"name": str}, {})["name"]
        poses.delete(name)
        return f"{name} is deleted"

    def plan(values: dict[str, Any]) -> str:
        given = taken(values, {"name": str}, {"speed": float})
        joints = poses.known(given["name"])
        seconds = poses.duration_s(joints, given.get("speed", SPEED))
        return json.dumps({"joints": dict(joints), "seconds": seconds})

    services: Mapping[str, Callable[[dict[str, Any]], str]] = {
        "save": save, "rename": rename, "delete": delete, "plan": plan
    }  # fmt: skip
    for name, handle in services.items():
        add_service(node, host, SetParametersAtomically, f"{POSES}/{name}", named_values(handle))
    poses.on_change = publish
    publish()
    yield
