"""Velocity limits that are set in a drive, compared with that of the joint."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from robotd.api import get_logger
from robotd_cia402.axis import Axis
from robotd_cia402.drive_scan import SAME_SCALE_SHARE, read_or_zero, stated_scales

log = get_logger("cia402")

_PROFILE_VELOCITY, _MOTOR_SPEED, _GEAR = 0x607F, 0x6080, 0x6091
_TURN_SHARE = 1e-3  # part by which counts_per_rad may differ from what the drive states


@dataclass(frozen=True)
class VelocityLimit:
    """A limit below that of the joint.

    Attributes:
        index, what: object that sets it, and its value in words.
        velocity: of the joint, rad/s or m/s.
    """

    index: int
    what: str
    velocity: float


def report_velocity_limits(axis: Axis[Any]) -> None:
    """Log, once for each object, where the drive clips what the joint may do. Worker.

    Nothing depends on it: an object that the drive does not have, or does not answer, says nothing.
    """
    limit = axis.scaling.joint_velocity
    for found in _lower_limits(axis, limit) if limit is not None else ():
        if axis.drive.is_news(found.index):
            log.warning(
                "the drive clips velocities below the limit of the joint",
                node=axis.drive.node.name,
                axis=axis.number,
                object=f"0x{found.index:04X} {found.what}",
                clips_at=f"{found.velocity:.4g} rad/s (or m/s)",
                joint_limit=f"{limit:.4g}",
                advice="raise the object in the drive, or lower velocity_rad_s of the joint",
            )


def _lower_limits(axis: Axis[Any], limit: float) -> Iterator[VelocityLimit]:
    scaling, drive = axis.scaling, axis.drive
    unit = abs(scaling.velocity)
    # 0 is no limit in some drives, and would be plain in the first motion in others.
    if value := read_or_zero(drive.read, _PROFILE_VELOCITY, 0):
        velocity = value * unit
        if velocity < limit - unit:
            what = f"(max profile velocity) is {value}"
            yield VelocityLimit(_PROFILE_VELOCITY, what, velocity)
    if value := read_or_zero(drive.read, _MOTOR_SPEED, 0):
        turns = _motor_turns(axis)
        velocity = value / 60.0 / turns if turns else math.inf
        if velocity < limit * (1.0 - _TURN_SHARE):
            yield VelocityLimit(_MOTOR_SPEED, f"(max motor speed) is {value} r/min", velocity)


def _motor_turns(axis: Axis[Any]) -> float:
    """Return turns of the motor per rad (or m) of the axis; 0 where they are not sure.

    The objects that state a turn are for reference only in some drives: two statements have to
    agree, that of ``counts_per_rad`` among them.
    """
    read, counts = axis.drive.read, axis.scaling.counts_per_unit
    stated = [*stated_scales(read).values()]
    if not stated or max(stated) > (1.0 + SAME_SCALE_SHARE) * min(stated):
        return 0.0
    configured = math.isclose(counts * 2.0 * math.pi, stated[0], rel_tol=_TURN_SHARE)
    if len(stated) < 2 and not configured:
        return 0.0
    motor, shaft = (read_or_zero(read, _GEAR, sub) or 1 for sub in (1, 2))
    return counts / stated[0] * motor / shaft
