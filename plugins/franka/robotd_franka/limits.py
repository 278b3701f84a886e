"""Limits of the arms: what FCI checks, made into limits that robotd can check before a motion.

FCI of the FR3 lowers the velocity limit of a joint towards its ends: ``√(2c·(end − q)) − b``
(libfranka, ``rate_limiting.h``; newer systems tell theirs in the robot's model). A joint that
brakes with ``a < c`` stays below it if its range ends ``b² / (2·(c − a))`` before FCI's. So each
joint has an acceleration below ``c`` here and a range that is smaller by that, and a goal is
rejected where the arm would answer with a reflex.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from robotd.api import AxisLimits

# lower and upper rad, velocity rad/s, acceleration rad/s²
FR3 = (
    AxisLimits(-2.735, 2.735, 2.61, 3.0),
    AxisLimits(-1.757, 1.757, 2.61, 2.0),
    AxisLimits(-2.88, 2.88, 2.61, 2.5),
    AxisLimits(-3.018, -0.176, 2.61, 2.5),
    AxisLimits(-2.80, 2.80, 5.25, 5.0),
    AxisLimits(0.566, 4.495, 4.17, 3.0),
    AxisLimits(-3.01, 3.01, 5.25, 5.0),
)

PANDA = (
    AxisLimits(-2.8973, 2.8973, 2.175, 15.0),
    AxisLimits(-1.7628, 1.7628, 2.175, 7.5),
    AxisLimits(-2.8973, 2.8973, 2.175, 10.0),
    AxisLimits(-3.0718, -0.0698, 2.175, 12.5),
    AxisLimits(-2.8973, 2.8973, 2.61, 15.0),
    AxisLimits(-0.0175, 3.7525, 2.61, 20.0),
    AxisLimits(-2.8973, 2.8973, 2.61, 20.0),
)

ARM_LIMITS: Mapping[str, Sequence[AxisLimits]] = {"fr3": FR3, "panda": PANDA}
