"""Node factory: imports what serves a name in a robot's ``nodes``, and makes the node."""

from __future__ import annotations

from pkgutil import resolve_name
from traceback import walk_tb
from typing import TYPE_CHECKING, Any

from robotd.errors import DescriptorError, PluginError, RobotdError, plugin_failure

if TYPE_CHECKING:
    from robotd.plugin.registry import NodeInfo
    from robotd.robot import Robot
    from robotd_ros.host import RosHost


def make_node(name: str, info: NodeInfo, robot: Robot, host: RosHost) -> Any:  # an rclpy.node.Node
    """Import and make one node; nothing is opened and nothing moves.

    Raises:
        DescriptorError: a parameter is wrong.
        PluginError: the factory cannot be imported or fails.
    """
    from robotd_ros.middleware import RCLError

    try:
        return resolve_name(info.factory)(robot, host)
    except RobotdError:
        raise
    except RCLError as error:
        raise _endpoint_error(name, error) from error
    except Exception as error:
        if info.factory.startswith(f"{__package__}."):
            raise  # a fault of robotd, with its traceback
        what = f"node {name!r} of plugin {info.owner}: {info.factory} cannot be made"
        raise PluginError(f"{what}: {plugin_failure(error, info.factory)}") from error


def _endpoint_error(name: str, error: Exception) -> DescriptorError:
    """Name the topic that rclpy did not create; its text names none, or no reason."""
    for frame, _ in walk_tb(error.__traceback__):
        values = frame.f_locals
        if frame.f_code.co_name in ("create_publisher", "create_subscription"):
            kind, topic = values["msg_type"], values["topic"]
            what = f"{topic!r} cannot be a topic of type {kind.__name__}"
            advice = "another topic of this robot has the name; choose another one"
            return DescriptorError(f"{what}: {advice}", key=name)
    return DescriptorError(str(error), key=name)
