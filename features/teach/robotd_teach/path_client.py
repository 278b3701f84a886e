"""Paths of a running robot, and their recording, as a client sees them."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from typing import Any

from std_msgs.msg import String
from std_srvs.srv import Trigger

from robotd.api import OperationError
from robotd_ros.client.ros_client import RosClient
from robotd_ros.qos import LATCHED

SERVICES = "robotd/paths"
KEPT_S = 0.2  # between two looks at a recording


def paths_of(client: RosClient) -> dict[str, Any]:
    """Return the fields of ``PathState`` of each path. Raises DeviceTimeout."""
    with client.listen(String, SERVICES, LATCHED) as messages:
        told: dict[str, Any] = json.loads(messages.wait().data)
    return told


def record(
    client: RosClient,
    values: Mapping[str, Any],
    is_ended: Callable[[], bool],
    on_state: Callable[[dict[str, Any]], None],
) -> str:
    """Record until ``is_ended``, save the path, and return what the robot says about it.

    Args:
        values: of ``begin``.
        on_state: called with the fields of ``RecordingState``, five times a second.

    Raises OperationError: it was rejected, or nothing was recorded; DeviceTimeout.
    """
    keeper = client.node.create_client(Trigger, f"{SERVICES}/keep")
    try:
        client.wait(keeper.service_is_ready, f"service {keeper.service_name}")
        client.call_named(f"{SERVICES}/begin", values)
        while not is_ended():
            future = keeper.call_async(Trigger.Request())
            client.wait(future.done, f"answer from {keeper.service_name}")
            response = future.result()
            if not response.success:
                raise OperationError(response.message)
            on_state(json.loads(response.message))
            due_s = time.monotonic() + KEPT_S
            while time.monotonic() < due_s and not is_ended():
                client.spin()
    finally:
        client.node.destroy_client(keeper)
    return client.trigger(f"{SERVICES}/end")
