"""Numbers in texts: value and limit never look equal when they differ."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from robotd.control.groups.descriptor_limits import trajectory_rules
from robotd.descriptor import TrajectorySettings
from robotd.errors import InvalidArgument
from robotd.motion import AxisLimits, JointLimits, JointTolerance, Tolerances, check_move
from robotd.motion.profile import Profile
from robotd.motion.rejection import distinct


@given(st.floats(allow_nan=False), st.floats(allow_nan=False))
@example(0.0, -0.0)
def test_texts_differ_when_the_numbers_do(value: float, limit: float) -> None:
    texts = distinct(value, limit)
    assert (texts[0] == texts[1]) == (value == limit)


@given(st.floats(allow_nan=False, allow_infinity=False), st.floats(0.1, 10.0))
def test_numbers_that_are_far_apart_stay_short(value: float, share: float) -> None:
    assert distinct(value, 2.0 * value + share)[0] == f"{value + 0.0:.5g}"


def test_a_move_just_beyond_its_limit() -> None:
    limits = AxisLimits(-1351774.0, 1351774.0, 3.0, 3.0)
    with pytest.raises(InvalidArgument) as rejected:
        check_move(limits, -1351774.25, Profile(1.0, 1.0, 1.0))
    assert str(rejected.value) == "target -1351774.2 rad is below -1351774 rad"


def test_an_error_just_beyond_its_tolerance() -> None:
    one = np.ones(1)
    joint = JointLimits(("a",), -one, one, one, one)
    rules = trajectory_rules(TrajectorySettings(), joint.units)
    tolerances = Tolerances(joint, rules, [JointTolerance("a", 0.01)])
    zero = np.zeros(1)
    violation = tolerances.path.check(0.0, zero, np.array([0.0100001]), zero, zero)
    assert str(violation) == (
        "a at 0.000 s: position error 0.0100001 rad exceeds path tolerance 0.01 rad"
    )
