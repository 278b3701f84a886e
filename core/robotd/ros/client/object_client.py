"""Objects (SDO) of the drives of a running robot."""

from __future__ import annotations

from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter

from robotd.errors import OperationError
from robotd.ros.client.ros_client import RosClient
from robotd.ros.nodes.object_services import READ, WRITE


def read_object(client: RosClient, **fields: int) -> str:
    """Return the value of an object as text; fields as of the service.

    Raises OperationError with the robot's reason, DeviceTimeout without a robot.
    """
    return _ask(client, READ, fields)


def write_object(client: RosClient, **fields: int) -> str:
    """Write an object; return the value read back. Raises as ``read_object`` does."""
    return _ask(client, WRITE, fields)


def _ask(client: RosClient, service: str, fields: dict[str, int]) -> str:
    parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in fields.items()]
    answer = client.call(SetParametersAtomically, service, parameters=parameters).result
    if not answer.successful:
        raise OperationError(answer.reason)
    return str(answer.reason)
