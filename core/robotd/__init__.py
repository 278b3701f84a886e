"""robotd: plugin-based robot driver framework for ROS 2.

``with open_robot("cr3a", "sim") as robot:`` gives a started robot without ROS.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from robotd.errors import (
    ConnectError,
    DescriptorError,
    DeviceTimeout,
    InvalidArgument,
    NotReady,
    OperationError,
    PluginError,
    RobotdError,
    Unsupported,
)

if TYPE_CHECKING:
    from robotd.robot import Robot, build_robot, open_robot

__all__ = [
    "ConnectError",
    "DescriptorError",
    "DeviceTimeout",
    "InvalidArgument",
    "NotReady",
    "OperationError",
    "PluginError",
    "Robot",
    "RobotdError",
    "Unsupported",
    "build_robot",
    "open_robot",
]


def __getattr__(name: str) -> Any:
    """Import the robot, and NumPy with it, on first use."""
    if name not in __all__:
        raise AttributeError(f"module 'robotd' has no attribute {name!r}")
    from robotd import robot

    return getattr(robot, name)
