"""Poses of a running robot, as a client sees them."""

from __future__ import annotations

import json
from typing import Any

from std_msgs.msg import String

from robotd_ros.client.ros_client import RosClient
from robotd_ros.qos import LATCHED

TOPIC = "robotd/poses"


def poses_of(client: RosClient) -> dict[str, Any]:
    """Return positions (``joints``) and ``problem`` of each pose. Raises DeviceTimeout."""
    with client.listen(String, TOPIC, LATCHED) as messages:
        told: dict[str, Any] = json.loads(messages.wait().data)
    return told
