"""Hand guiding of a running robot, as a client keeps it up."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from robotd_msgs.srv import BeginGuiding, KeepGuiding

from robotd.api import OperationError
from robotd_ros.client.ros_client import RosClient, escape_texts

SERVICES = "robotd/guide"
KEPT_PER_LEASE = 5  # calls: a lost one ends nothing


def guide(
    client: RosClient,
    values: dict[str, Any],
    lease_s: float,
    is_ended: Callable[[], bool],
    on_state: Callable[[Any], None],
) -> str:
    """Begin, and keep it up until ``is_ended``; return how it ended, with the joints held.

    Args:
        values: of the request, besides the lease.
        on_state: called with each answer to ``keep``.

    Raises OperationError: it was rejected, or has ended for another reason; DeviceTimeout.
    """
    keeper = client.node.create_client(KeepGuiding, f"{SERVICES}/keep")
    try:
        client.wait(keeper.service_is_ready, f"service {keeper.service_name}")
        client.call(BeginGuiding, f"{SERVICES}/begin", **values, lease_s=lease_s)
        while not is_ended():
            future = keeper.call_async(KeepGuiding.Request())
            client.wait(future.done, f"answer from {keeper.service_name}")
            response = future.result()
            escape_texts(response)
            if not response.success:
                raise OperationError(response.message)
            on_state(response)
            due_s = time.monotonic() + lease_s / KEPT_PER_LEASE
            while time.monotonic() < due_s and not is_ended():
                client.spin()
    finally:
        client.node.destroy_client(keeper)
    return client.trigger(f"{SERVICES}/end")
