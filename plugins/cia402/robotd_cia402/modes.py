"""Modes of operation (object 0x6060) and supported modes (0x6502)."""

from __future__ import annotations

from enum import IntEnum

from robotd.api import CommandMode
from robotd_cia402.options import DriveOptions, SetpointMode, VelocityMode


class OperationMode(IntEnum):
    """Numbers of objects 0x6060 and 0x6061.

    Attributes:
        is_cyclic_position: the setpoint is a position in each frame.
        is_velocity, is_torque: the setpoint is a velocity or a torque.
        is_ours: the drive makes no ramp of its own: in the cyclic modes except that of torque.
        has_following_bit: bit 12 of the statusword tells whether setpoints are followed.
    """

    NONE = 0
    PROFILE_POSITION = 1
    PROFILE_VELOCITY = 3
    HOMING = 6
    INTERPOLATED_POSITION = 7
    CYCLIC_POSITION = 8
    CYCLIC_VELOCITY = 9
    CYCLIC_TORQUE = 10

    def __init__(self, number: int) -> None:
        # Plain attributes: they are read for each axis in each period.
        self.is_cyclic_position = number in (7, 8)
        self.is_velocity = number in (3, 9)
        self.is_torque = number == 10
        self.is_ours = number in (7, 8, 9)
        self.has_following_bit = number in (8, 9, 10)

    @property
    def support_bit(self) -> int:
        """Bit of object 0x6502; bit n - 1 is mode n (CiA 402-2, 0x6502)."""
        return 1 << (self.value - 1)


HOMING_AT_REST = (35, 37)
"""Homing methods (0x6098) that take the present position; all others move, or may (CiA 402-2)."""
TORQUE_MODES = (4, 10)
"""Numbers of profile torque, which robotd never requests, and of cyclic torque."""
_NAMES = {mode.value: mode.name.lower().replace("_", " ") for mode in OperationMode}
_NAMES |= {2: "velocity", 4: "profile torque"}  # which robotd never requests

STREAM_MODES = {
    SetpointMode.CSP: OperationMode.CYCLIC_POSITION,
    SetpointMode.IP: OperationMode.INTERPOLATED_POSITION,
}
VELOCITY_MODES = {
    VelocityMode.PV: OperationMode.PROFILE_VELOCITY,
    VelocityMode.CSV: OperationMode.CYCLIC_VELOCITY,
}
VELOCITY = tuple(VELOCITY_MODES.values())


def mode_text(number: int) -> str:
    """Return ``mode 4 (profile torque)``; without a name for one of the vendor's."""
    name = _NAMES.get(number)
    return f"mode {number} ({name})" if name else f"mode {number}"


def rest_mode(options: DriveOptions, command: CommandMode) -> OperationMode:
    """Return the mode of an axis without a command; it holds unless in velocity mode."""
    if command is CommandMode.VELOCITY:
        return VELOCITY_MODES[options.velocity_mode]
    return STREAM_MODES[options.stream_mode]


def needed_modes(options: DriveOptions) -> dict[OperationMode, str]:
    """Return the modes that the drive must support, with the option that needs each."""
    needed = {
        STREAM_MODES[options.stream_mode]: "stream_mode",
        VELOCITY_MODES[options.velocity_mode]: "velocity_mode",
    }
    if options.guiding_damping_nm_s_rad is not None:
        needed[OperationMode.CYCLIC_TORQUE] = "guiding_damping_nm_s_rad"
    return needed
