"""Motions within robotd's limits of an arm stay within those that FCI checks."""

from __future__ import annotations

import numpy as np
import pytest

from robotd.api import load_robot_descriptor
from robotd_franka.limits import ARM_LIMITS, FR3

# FCI of the FR3: v(q) = sqrt(2 c (end - q)) - b below an upper end, mirrored above a lower one, at
# most v_max. Of each joint: c, b, ends, v_max; libfranka's rate_limiting.h, system 5.8 and older.
OLDER = (
    (6.0, 0.30, -2.7501, 2.7501, 2.62),
    (2.585, 0.20, -1.7918, 1.7918, 2.62),
    (3.5, 0.20, -2.9065, 2.9065, 2.62),
    (4.0, 0.30, -3.0481, -0.1458, 2.62),
    (17.0, 0.35, -2.8101, 2.8101, 5.26),
    (5.5, 0.35, 0.54092, 4.5205, 4.18),
    (17.0, 0.35, -3.0196, 3.0196, 5.26),
)
# The same of the model that a controller of system 5.9 sends.
NEWER = (
    (6.0, 0.652, -2.9007, 2.9007, 2.62),
    (2.585, 0.25, -1.8361, 1.8361, 2.62),
    (3.5, 0.2005, -2.9007, 2.9007, 2.62),
    (4.0, 0.3542, -3.077, -0.1169, 2.62),
    (17.0, 0.5738, -2.8763, 2.8763, 5.26),
    (5.5, 0.4885, 0.4398, 4.6216, 4.18),
    (17.0, 0.4592, -3.0508, 3.0508, 5.26),
)


@pytest.mark.parametrize("system", [OLDER, NEWER], ids=["older", "newer"])
def test_braking_at_an_end_stays_below_the_limit_that_falls_towards_it(
    system: tuple[tuple[float, ...], ...],
) -> None:
    for limits, (c, b, lower, upper, fastest) in zip(FR3, system, strict=True):
        assert lower < limits.lower
        assert limits.upper < upper
        assert limits.acceleration < 10.0
        way = np.linspace(0.0, (limits.upper - limits.lower) / 2, 2000)
        speed = np.minimum(np.sqrt(2 * limits.acceleration * way), limits.velocity)
        for end in (upper - limits.upper, limits.lower - lower):
            allowed = np.minimum(fastest, np.sqrt(2 * c * (way + end)) - b)
            assert (speed <= allowed).all()


@pytest.mark.parametrize("name", ["fr3", "panda"])
def test_a_robot_is_within_the_limits_of_its_arm(name: str) -> None:
    joints = load_robot_descriptor(name).joints
    assert len(joints) == len(ARM_LIMITS[name])
    for joint, limits in zip(joints, ARM_LIMITS[name], strict=True):
        assert limits.lower <= joint.lower < joint.upper <= limits.upper
        assert joint.velocity <= limits.velocity
        assert joint.acceleration <= limits.acceleration
