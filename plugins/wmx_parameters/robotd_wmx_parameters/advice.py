"""Values of a WMX parameter file that are accepted and still unwise for a robot."""

from __future__ import annotations

from collections.abc import Iterable

from robotd.api import RobotDescriptor
from robotd_wmx_parameters.parameters import WmxParameters

QUICK_STOP_RATIO = 10.0  # of QuickStopDec to the joint's acceleration limit
SUGGESTED_RATIO = 2.0


def parameter_warnings(parameters: WmxParameters, robot: RobotDescriptor) -> list[str]:
    """Return one sentence for each unwise value of the robot's joints, with what to set.

    Assumes that the user unit is rad or m, as a gear denominator of 2π makes it.
    """
    return [*_quick_stop(parameters, robot), *_following_error(parameters, robot)]


def _quick_stop(parameters: WmxParameters, robot: RobotDescriptor) -> Iterable[str]:
    """The engine uses QuickStopDec for every stop in a command's first cycle too."""
    steep = []
    for joint in robot.joints:
        value = float(parameters["QuickStopDec"][joint.axis])
        if value > QUICK_STOP_RATIO * joint.acceleration:
            suggested = SUGGESTED_RATIO * joint.acceleration
            steep.append((value, suggested, joint.unit, joint.name))
    for value, suggested, unit in sorted({key[:3] for key in steep}):
        key = (value, suggested, unit)
        names = ", ".join(name for *of, name in steep if tuple(of) == key)
        yield (
            f"{names}: QuickStopDec of {value:g} {unit}/s² stops within a cycle, and the engine"
            " uses it for plain stops in a command's first cycle;"
            f" set about twice the joint's acceleration limit: {suggested:.3g} {unit}/s²"
        )


def _following_error(parameters: WmxParameters, robot: RobotDescriptor) -> Iterable[str]:
    unwatched = [
        joint.name
        for joint in robot.joints
        if not parameters["FollowingErrorMoving"][joint.axis]
        or not parameters["FollowingErrorStopped"][joint.axis]
        or not parameters["FollowingErrorType"][joint.axis]
    ]
    if unwatched:
        yield (
            f"{', '.join(unwatched)}: the engine does not watch the following error; set"
            " FollowingErrorType 1 (quick stop), FollowingErrorMoving and FollowingErrorStopped"
        )
