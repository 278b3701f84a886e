"""Objects (SDO) of the drives of a running robot."""

from __future__ import annotations

from robotd.ros.client.ros_client import RosClient
from robotd.ros.nodes.object_services import READ, WRITE


def read_object(client: RosClient, **fields: int) -> str:
    """Return the value of an object as text; fields as of the service.

    Raises OperationError with the robot's reason, DeviceTimeout without a robot.
    """
    return client.call_named(READ, fields)


def write_object(client: RosClient, **fields: int) -> str:
    """Write an object; return the value read back. Raises as ``read_object`` does."""
    return client.call_named(WRITE, fields)
