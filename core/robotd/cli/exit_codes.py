"""What the exit status says: one number for each phase that can fail."""

from __future__ import annotations

from enum import IntEnum

from robotd.errors import (
    ConnectError,
    DescriptorError,
    DeviceTimeout,
    InvalidArgument,
    OperationError,
    PluginError,
    RobotdError,
)


class RosUnavailable(RobotdError):
    """ROS 2 is not installed, does not fit, or does not start."""


class Rejected(RobotdError):
    """A running robot refused or aborted what a command asked of it."""


class ExitCode(IntEnum):
    """The exit statuses of ``robotd``; docs/reference/cli.md explains them."""

    OK = 0
    FAILED = 1
    USAGE = 2
    CONFIGURATION = 3
    PLUGIN = 4
    DEVICE = 5
    ROS = 6
    INTERRUPTED = 130


_PHASES: tuple[tuple[type[RobotdError], ExitCode], ...] = (
    (DescriptorError, ExitCode.CONFIGURATION),
    (InvalidArgument, ExitCode.CONFIGURATION),
    (PluginError, ExitCode.PLUGIN),
    (ConnectError, ExitCode.DEVICE),
    (DeviceTimeout, ExitCode.DEVICE),
    (OperationError, ExitCode.DEVICE),
    (RosUnavailable, ExitCode.ROS),
    (Rejected, ExitCode.FAILED),
)


def exit_code(error: Exception) -> ExitCode:
    """The exit status for an error that ended the command."""
    for kind, code in _PHASES:
        if isinstance(error, kind):
            return code
    return ExitCode.FAILED
