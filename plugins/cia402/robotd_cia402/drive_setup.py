"""Set-up of a drive axis before its first cyclic frame: supported modes and option codes."""

from __future__ import annotations

import math

from robotd.api import OperationError
from robotd_cia402.axis import Axis
from robotd_cia402.modes import needed_modes

_HALT_RAMP, _QUICK_STOP_STAYS, _FAULT_ON_LOSS = 1, 6, 1  # 0x605D, 0x605A, 0x6007


def set_up(axis: Axis, period_s: float) -> None:
    """Check the supported modes and write the option codes. Nothing moves. Worker.

    Args:
        axis: its node is configured; what is known of its state is forgotten.
        period_s: between two cyclic frames, the interpolation time period (object 0x60C2).

    Raises OperationError naming the option that needs a mode, SdoAbort and DeviceTimeout.
    """
    options, drive = axis.options, axis.drive
    supported = drive.read(0x6502)
    for mode, what in needed_modes(options).items():
        if not supported & mode.support_bit:
            raise OperationError(
                f"modes: {what} needs {mode.name.lower()}, which object 0x6502"
                f" (0x{supported:08X}) does not offer"
            )
    value, exponent = interpolation_period(period_s)
    for index, sub, number in (
        (0x6007, 0, _FAULT_ON_LOSS),
        (0x605A, 0, _QUICK_STOP_STAYS),
        (0x605D, 0, _HALT_RAMP),
        (0x60C2, 1, value),
        (0x60C2, 2, exponent),
    ):
        if drive.has(index):
            drive.write(index, sub, number)
    write_quick_stop_ramp(axis)
    axis.forget()


def write_quick_stop_ramp(axis: Axis) -> None:
    """Write the ramp of the quick stop, in the scale in force. Worker.

    Raises as ``set_up``.
    """
    if axis.drive.has(0x6085):
        ramp = axis.scaling.ramp_units(axis.options.quick_stop_deceleration_rad_s2)
        axis.drive.write(0x6085, 0, ramp)


def interpolation_period(period_s: float) -> tuple[int, int]:
    """Return object 0x60C2, value (1 byte) and power of ten, as exactly as they allow.

    In milliseconds where possible: some drives take no other power than -3.
    """
    for exponent in (-3, -4, -5, -6, -2, -1, 0):
        value = period_s / 10.0**exponent
        if value <= 255 and math.isclose(value, round(value), rel_tol=1e-6):
            return round(value), exponent
    return max(1, min(255, round(period_s * 1000))), -3
