"""Paths of a running robot, and their recording, as a client sees them."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from robotd_msgs.msg import SavedPaths
from robotd_msgs.srv import BeginPath, DeletePath, KeepPath, PlanPath, RenamePath

from robotd.api import OperationError
from robotd_ros.client.ros_client import RosClient, escape_texts
from robotd_ros.qos import LATCHED

TOPIC = "robotd/paths"
KEPT_S = 0.2  # between two looks at a recording
PLAN_TIMEOUT_S = 30.0  # of a long path, on a slow computer
TIMINGS = {"recorded": PlanPath.Request.RECORDED, "limits": PlanPath.Request.LIMITS}


def paths_of(client: RosClient) -> dict[str, Any]:
    """Return the fields of ``SavedPath`` of each path by its name. Raises DeviceTimeout."""
    with client.listen(SavedPaths, TOPIC, LATCHED) as messages:
        paths = messages.wait().paths
    return {
        path.name: {
            "joints": [*path.joints],
            "duration_s": path.duration_s,
            "points": path.points,
            "problem": path.problem,
        }
        for path in paths
    }


def record(
    client: RosClient,
    values: dict[str, Any],
    is_ended: Callable[[], bool],
    on_state: Callable[[Any], None],
) -> str:
    """Record until ``is_ended``, save the path, and return what the robot says about it.

    Args:
        values: of the request to begin.
        on_state: called with each answer to ``keep``, five times a second.

    Raises OperationError: it was rejected, or nothing was recorded; DeviceTimeout.
    """
    keeper = client.node.create_client(KeepPath, f"{TOPIC}/keep")
    try:
        client.wait(keeper.service_is_ready, f"service {keeper.service_name}")
        client.call(BeginPath, f"{TOPIC}/begin", **values)
        while not is_ended():
            future = keeper.call_async(KeepPath.Request())
            client.wait(future.done, f"answer from {keeper.service_name}")
            response = future.result()
            escape_texts(response)
            if not response.success:
                raise OperationError(response.message)
            on_state(response)
            due_s = time.monotonic() + KEPT_S
            while time.monotonic() < due_s and not is_ended():
                client.spin()
    finally:
        client.node.destroy_client(keeper)
    return end(client)


def end(client: RosClient) -> str:
    """End the recording under way and save its path. Raises the errors of ``call``."""
    return client.trigger(f"{TOPIC}/end")


def plan(client: RosClient, name: str, *, timing: str, speed: float | None, **request: Any) -> Any:
    """Return the answer of ``PlanPath``. Raises the errors of ``call``.

    Args:
        timing: "recorded" or "limits".
        speed: part of what ``timing`` names; None: see ``PlanPath``.
        request: its other fields.
    """
    own_s, client.timeout_s = client.timeout_s, max(client.timeout_s, PLAN_TIMEOUT_S)
    try:
        return client.call(
            PlanPath,
            f"{TOPIC}/plan",
            name=name,
            timing=TIMINGS[timing],
            speed=speed or 0.0,
            **request,
        )
    finally:
        client.timeout_s = own_s


def rename(client: RosClient, name: str, new_name: str) -> str:
    """Give a path another name. Raises the errors of ``call``."""
    request = {"name": name, "new_name": new_name}
    return str(client.call(RenamePath, f"{TOPIC}/rename", **request).message)


def delete(client: RosClient, name: str) -> str:
    """Delete a path. Raises the errors of ``call``."""
    return str(client.call(DeletePath, f"{TOPIC}/delete", name=name).message)
