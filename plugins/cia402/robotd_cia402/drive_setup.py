"""Set-up of a drive axis before its first cyclic frame: modes, position range, option codes."""

from __future__ import annotations

import math
from typing import Any

from robotd.api import OperationError, get_logger
from robotd_cia402.axis import Axis
from robotd_cia402.drive_access import SdoAbort
from robotd_cia402.drive_limits import report_velocity_limits
from robotd_cia402.modes import needed_modes
from robotd_cia402.options import DriveOptions
from robotd_cia402.scaling import wrapped

log = get_logger("cia402")

_SUPPORTED_MODES, _QUICK_STOP_RAMP, _PERIOD = 0x6502, 0x6085, 0x60C2
_CONNECTION_LOST = 0x6007  # reaction to it
_POSITION_RANGE = 0x607B
_MAX_COUNTS = (1 << 31) - 1  # of a position of 32 bits
_STOPPING = (
    1,
    2,
    3,
)  # values of it with which a drive does not go on: fault, power off, quick stop
_OPTION_CODES = {
    _CONNECTION_LOST: (1, "the drive may go on when robotd is lost"),
    0x605A: (6, "a quick stop may end with the servo off"),
    0x605D: (1, "the halt of a move may have another ramp"),
}
"""Object → value, and effect of another one."""


def set_up(axis: Axis[Any], period_s: float) -> None:
    """Check modes and position range, write option codes, report limits. Nothing moves. Worker.

    The objects in ``STARTUP_WRITES`` are optional: one that is missing, cannot be written or is
    skipped keeps the value of the drive, which is logged once.

    Args:
        axis: its node is configured; what is known of its state is forgotten.
        period_s: between two cyclic frames, the interpolation time period (object 0x60C2).

    Raises OperationError naming the option that needs a mode, or a position range that the joint
    leaves, and DeviceTimeout.
    """
    if axis.options.check_modes:
        _check_modes(axis)
    _check_position_range(axis)
    for index, (value, otherwise) in _OPTION_CODES.items():
        written = _write(axis, index, 0, value, otherwise)
        if index == _CONNECTION_LOST:
            axis.drive.unreacting = "" if written else _reaction(axis)
    _write_period(axis, period_s)
    axis.report.period_s = period_s
    write_quick_stop_ramp(axis)
    report_velocity_limits(axis)
    axis.report.read_error_register()  # of an alarm whose emergency was sent before
    axis.forget()


def write_quick_stop_ramp(axis: Axis[Any]) -> None:
    """Write the ramp of the quick stop, in the scale in force. Worker.

    Raises the errors of ``set_up``.
    """
    ramp = axis.scaling.ramp_units(axis.options.quick_stop_deceleration_rad_s2)
    _write(axis, _QUICK_STOP_RAMP, 0, ramp, "a quick stop has the ramp that is set in the drive")


def interpolation_period(period_s: float) -> tuple[int, int]:
    """Return object 0x60C2, value (1 byte) and power of ten, as exactly as they allow.

    In milliseconds where possible: some drives take no other power than -3.
    """
    for exponent in (-3, -4, -5, -6, -2, -1, 0):
        value = period_s / 10.0**exponent
        if value <= 255 and math.isclose(value, round(value), rel_tol=1e-6):
            return round(value), exponent
    return max(1, min(255, round(period_s * 1000))), -3


def _check_modes(axis: Axis[Any]) -> None:
    try:
        supported = axis.drive.read(_SUPPORTED_MODES)
    except SdoAbort as error:
        raise OperationError(f"modes: {error.reason}; {_WITHOUT_MODES}") from error
    if reason := missing_mode(supported, axis.options):
        raise OperationError(f"modes: {reason}")


def _check_position_range(axis: Axis[Any]) -> None:
    """Raise OperationError where positions wrap (object 0x607B) within the limits of the joint.

    A target beyond the range would be taken for one at its other end. Both values are 0 where
    the drive does not use the object (CiA 402-2, 0x607B).
    """
    drive = axis.drive
    try:
        lowest, highest = (wrapped(drive.read(_POSITION_RANGE, sub)) for sub in (1, 2))
    except SdoAbort:
        return
    if lowest >= highest or (lowest <= -_MAX_COUNTS and highest >= _MAX_COUNTS):
        return
    ends = sorted(limit / axis.scaling.position for limit in axis.scaling.position_limits)
    if lowest <= ends[0] and ends[1] <= highest:
        return
    needed = " to ".join(f"{end:.0f}" if math.isfinite(end) else "no limit" for end in ends)
    raise OperationError(
        f"object 0x607B: positions of {drive.node.label} wrap at {lowest} and {highest} counts,"
        f" axis {axis.number} needs {needed}; let the range span 32 bits, or set both of its values"
        " to 0"
    )


def missing_mode(supported: int, options: DriveOptions) -> str:
    """Return why ``supported``, the value of 0x6502, does not suffice; "" if it does."""
    if not supported:
        return f"object 0x6502 is 0; {_WITHOUT_MODES}"
    for mode, what in needed_modes(options).items():
        if not supported & mode.support_bit:
            offered = f"which object 0x6502 (0x{supported:08X}) does not offer"
            return f"{what} needs {mode.name.lower()}, {offered}"
    return ""


_WITHOUT_MODES = "if its manual lists the modes that are needed, set check_modes: false"


def _write_period(axis: Axis[Any], period_s: float) -> None:
    """Write the interpolation period; the power first, because it gives the value its meaning."""
    value, exponent = interpolation_period(period_s)
    otherwise = f"the drive must expect a frame each {period_s * 1000:g} ms by its own setting"
    if _write(axis, _PERIOD, 2, exponent, otherwise):
        _write(axis, _PERIOD, 1, value, otherwise)


def _reaction(axis: Axis[Any]) -> str:
    """Return why a drive need not stop whose 0x6007 is not written; "": its own value stops it."""
    try:
        value = axis.drive.read(_CONNECTION_LOST)
    except SdoAbort:
        return "it has no object 0x6007"
    return "" if value in _STOPPING else f"0x6007 is {value}, and is not written"


def _write(axis: Axis[Any], index: int, sub: int, value: int, otherwise: str) -> bool:
    """Write an optional object; False, with ``otherwise`` in the log, where it is not written."""
    drive = axis.drive
    if index in axis.options.skip_writes:
        return False
    reason = f"0x{index:04X} is missing or read-only"
    if drive.writable(index, sub):
        try:
            drive.write(index, sub, value)
        except SdoAbort as error:
            reason = error.reason
        else:
            return True
    if drive.is_news(index):
        log.warning("object not written", node=drive.node.label, reason=reason, effect=otherwise)
    return False
