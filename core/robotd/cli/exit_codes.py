"""Exit statuses: one number for each phase that can fail."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum

from robotd.errors import (
    ConnectError,
    DescriptorError,
    DeviceTimeout,
    InvalidArgument,
    OperationError,
    PluginError,
    RecordingError,
    RobotdError,
)


class RosUnavailable(RobotdError):
    """ROS 2 is not installed, does not fit, or does not start."""


class Rejected(RobotdError):
    """A running robot rejected or aborted what a command asked of it."""


class ServosNotOff(RobotdError):
    """Drives have not confirmed to be off after the end of the robot: cut their power."""

    def __init__(self, names: Sequence[str]) -> None:
        super().__init__(
            f"{', '.join(names)}: not confirmed to be off; cut the power of the drives"
        )


class ExitCode(IntEnum):
    """Exit status of ``robotd``."""

    OK = 0
    """Stopped in order, or no problem was found."""
    FAILED = 1
    """The robot rejected or aborted the request, has no such name, or cannot move; a new folder
    could not be made; or an internal error."""
    USAGE = 2
    """The command line is wrong."""
    CONFIGURATION = 3
    """A descriptor, parameter file, scenario or recording is wrong or missing; or a ROS parameter
    is wrong."""
    PLUGIN = 4
    """The backend or another plugin is missing or broken."""
    DEVICE = 5
    """The device could not be opened or failed, or no running robot answered."""
    ROS = 6
    """ROS 2 is not installed or does not start."""
    SERVOS_NOT_OFF = 7
    """`robotd run` has ended in order, but drives have not confirmed to be off: cut their power. An
    error that ended the run has its own status; the log names the drives then."""
    INTERRUPTED = 130
    """Ended by a second signal, or by Ctrl-C before anything was running."""


_PHASES: tuple[tuple[type[RobotdError], ExitCode], ...] = (
    (DescriptorError, ExitCode.CONFIGURATION),
    (RecordingError, ExitCode.CONFIGURATION),
    (InvalidArgument, ExitCode.CONFIGURATION),
    (PluginError, ExitCode.PLUGIN),
    (ConnectError, ExitCode.DEVICE),
    (DeviceTimeout, ExitCode.DEVICE),
    (OperationError, ExitCode.DEVICE),
    (RosUnavailable, ExitCode.ROS),
    (Rejected, ExitCode.FAILED),
    (ServosNotOff, ExitCode.SERVOS_NOT_OFF),
)


def exit_code(error: Exception) -> ExitCode:
    """The exit status for an error that ended the command."""
    for kind, code in _PHASES:
        if isinstance(error, kind):
            return code
    return ExitCode.FAILED
