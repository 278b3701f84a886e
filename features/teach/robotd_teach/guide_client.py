"""Hand guiding of a running robot, as a client keeps it up."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from typing import Any

from std_srvs.srv import Trigger

from robotd.api import OperationError
from robotd_ros.client.ros_client import RosClient

SERVICES = "robotd/guide"
KEPT_PER_LEASE = 5  # calls: a lost one ends nothing


def guide(
    client: RosClient,
    values: dict[str, Any],
    lease_s: float,
    is_ended: Callable[[], bool],
    on_state: Callable[[dict[str, Any]], None],
) -> str:
    """Begin, and keep it up until ``is_ended``; return how it ended, with the joints held.

    Args:
        values: of ``HandGuiding.begin``, besides the lease.
        on_state: called with the fields of ``GuidingState``.

    Raises OperationError: it was rejected, or has ended for another reason; DeviceTimeout.
    """
    keeper = client.node.create_client(Trigger, f"{SERVICES}/keep")
    try:
        client.wait(keeper.service_is_ready, f"service {keeper.service_name}")
        client.call_named(f"{SERVICES}/begin", {**values, "lease_s": lease_s})
        while not is_ended():
            future = keeper.call_async(Trigger.Request())
            client.wait(future.done, f"answer from {keeper.service_name}")
            response = future.result()
            if not response.success:
                raise OperationError(response.message)
            on_state(json.loads(response.message))
            due_s = time.monotonic() + lease_s / KEPT_PER_LEASE
            while time.monotonic() < due_s and not is_ended():
                client.spin()
    finally:
        client.node.destroy_client(keeper)
    return client.trigger(f"{SERVICES}/end")
