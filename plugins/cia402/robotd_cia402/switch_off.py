"""End of operation: axes to rest, and their servos off."""

from __future__ import annotations

from collections.abc import Iterable

from robotd.api import Clock, RobotdError, get_logger, wait_until
from robotd_cia402.axis import Axis
from robotd_cia402.commands import Commands

log = get_logger("cia402")

_SERVO_S = 0.5  # for one servo, while the control loop may not be running


def switch_off(axes: Iterable[Axis], timeout_s: float, clock: Clock) -> None:
    """Stop the axes that are powered, then switch their servos off. Worker.

    A servo that is being switched on goes off when that has ended.

    Args:
        axes: those whose node is lost are left alone: their drives stop by themselves.
        timeout_s: for all to come to rest; then the servos are switched off in motion.

    A servo that does not go off is logged; the others are switched off all the same.
    """
    online = [axis for axis in axes if axis.drive.online]
    live = [axis for axis in online if axis.report.powered]
    for axis in live:
        axis.brake(axis.options.stop_deceleration_rad_s2)
    wait_until(lambda: all(axis.activity.is_idle for axis in live), timeout_s, clock)
    for axis in online:
        with axis.lock:  # of a command that still switches on
            if axis.report.powered:
                _disable(axis, clock)


def _disable(axis: Axis, clock: Clock) -> None:
    try:
        Commands(axis, clock).disable(_SERVO_S)
    except RobotdError as error:
        log.warning("switching off failed", axis=axis.number, reason=str(error))
