"""Switching a drive off by SDO, where its cyclic frames do not show that it is off."""

from __future__ import annotations

from typing import Any

from robotd.api import Clock, RobotdError, get_logger, wait_until
from robotd_cia402.axis import Axis
from robotd_cia402.controlword import POWERED, Control, DriveState, drive_state

log = get_logger("cia402")

_CONTROLWORD, _STATUSWORD, _VELOCITY = 0x6040, 0x6041, 0x606C
_REST_VELOCITY_RAD_S = 0.01
_STOP_TIMEOUT_S = 1.0  # for a quick stop, before the power goes off in motion
_OFF_TIMEOUT_S = 0.5


def switch_off_by_sdo(axis: Axis[Any], clock: Clock) -> bool:
    """Stop the axis and switch its power off; return whether the drive confirms. Worker.

    The cyclic frames hold no controlword meanwhile. A drive that does not answer is not asked
    twice: its time-outs would hold up the end of the robot.
    """
    drive = axis.drive
    try:
        if _state(axis) is DriveState.OPERATION_ENABLED:
            drive.write(_CONTROLWORD, 0, int(Control.QUICK_STOP))
            wait_until(lambda: _rests(axis), _STOP_TIMEOUT_S, clock)
        drive.write(_CONTROLWORD, 0, int(Control.DISABLE_VOLTAGE))
        off = wait_until(lambda: _state(axis) not in POWERED, _OFF_TIMEOUT_S, clock)
    except RobotdError as error:
        log.warning("switching off by SDO failed", axis=axis.number, reason=str(error))
        return False
    axis.power.may_be_on = axis.power.may_be_on and not off
    return off


def _state(axis: Axis[Any]) -> DriveState:
    return drive_state(axis.drive.read(_STATUSWORD))


def _rests(axis: Axis[Any]) -> bool:
    """Return True for a drive that is at rest, or has ended its quick stop by itself."""
    if _state(axis) is not DriveState.QUICK_STOP_ACTIVE:
        return True
    velocity = axis.drive.read(_VELOCITY) * axis.scaling.velocity
    return bool(abs(velocity) < _REST_VELOCITY_RAD_S)
