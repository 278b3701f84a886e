"""A limited twist stays on the commanded arc, within every limit, and comes to rest in time."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotd.motion.base_twist_limits import RampLimits, TwistLimiter, TwistLimits
from robotd.motion.planar import ZERO_TWIST, PlanarTwist
from robotd_bases.mecanum import MecanumWheels

PERIOD_S = 0.01
ROUNDING = 1e-9

rates = st.floats(0.1, 10.0)
ramps = st.builds(RampLimits, rates, rates, rates, st.just(math.inf))
smooth_ramps = st.builds(RampLimits, rates, rates, rates, st.floats(2.0, 100.0))
rims, levers = st.floats(0.1, 10.0), st.floats(0.05, 1.0)
limits = st.builds(TwistLimits, ramps, ramps, rims, levers, ramps)
smooth_limits = st.builds(
    TwistLimits, smooth_ramps, smooth_ramps, st.just(math.inf), levers, smooth_ramps
)
speeds = st.floats(-20.0, 20.0).map(lambda value: round(value, 6))
twists = st.builds(PlanarTwist, speeds, speeds, st.one_of(st.just(0.0), speeds))
commands = st.lists(st.tuples(twists, st.integers(1, 60)), min_size=1, max_size=8)


def driven(limiter: TwistLimiter, phases: Sequence[tuple[PlanarTwist, int]]) -> list[PlanarTwist]:
    """The twists from rest, for each (command, number of periods) in turn."""
    steps = [limiter.step(command) for command, count in phases for _ in range(count)]
    return [ZERO_TWIST, *steps]


def rim_speeds(all_limits: TwistLimits, twist: PlanarTwist) -> tuple[float, ...]:
    """Rim speeds of four mecanum wheels with the lever of the limits."""
    return MecanumWheels(1.0, all_limits.lever, all_limits.lever).speeds(twist)


def same_direction(twist: PlanarTwist, command: PlanarTwist) -> bool:
    """Equal curvature, and not backwards: the sine of the angle between the two vanishes.

    Below 1e-12 m/s and rad/s there is rounding and no direction.
    """
    if math.hypot(*twist) < 1e-12:
        return True
    size = math.hypot(*twist) * math.hypot(*command)
    across = float(np.linalg.norm(np.cross(twist, command)))
    return across <= 1e-9 * size and float(np.dot(twist, command)) >= 0.0


@given(limits, twists, st.integers(1, 200))
def test_from_rest_and_back_the_curvature_is_the_commanded_one(
    all_limits: TwistLimits, command: PlanarTwist, count: int
) -> None:
    limiter = TwistLimiter(all_limits, PERIOD_S)
    for twist in driven(limiter, [(command, count), (ZERO_TWIST, count)]):
        assert same_direction(twist, command)


@given(smooth_limits, twists, st.integers(1, 100))
def test_smoothing_keeps_the_curvature_too(
    all_limits: TwistLimits, command: PlanarTwist, count: int
) -> None:
    limiter = TwistLimiter(all_limits, PERIOD_S)
    for twist in driven(limiter, [(command, count)]):
        assert same_direction(twist, command)


@given(limits, commands)
def test_no_limit_is_exceeded(
    all_limits: TwistLimits, phases: list[tuple[PlanarTwist, int]]
) -> None:
    steps = driven(TwistLimiter(all_limits, PERIOD_S), phases)
    for twist in steps:
        assert max(map(abs, rim_speeds(all_limits, twist))) <= all_limits.rim * (1 + ROUNDING)
    for part, ramp in enumerate(all_limits.parts):
        for before, after in pairwise(twist[part] for twist in steps):
            assert abs(after) <= ramp.velocity * (1 + ROUNDING)
            assert before * after >= 0.0, "a reversal skips standstill"
            slope = ramp.acceleration if abs(after) > abs(before) else ramp.deceleration
            assert abs(after - before) <= slope * PERIOD_S * (1 + ROUNDING) + ROUNDING


@given(smooth_limits, commands)
def test_no_limit_is_exceeded_with_a_limited_jerk(
    all_limits: TwistLimits, phases: list[tuple[PlanarTwist, int]]
) -> None:
    steps = driven(TwistLimiter(all_limits, PERIOD_S), phases)
    for part, ramp in enumerate(all_limits.parts):
        values = [twist[part] for twist in steps]
        slopes = [(after - before) / PERIOD_S for before, after in pairwise(values)]
        steepest = max(ramp.acceleration, ramp.deceleration)
        assert max(map(abs, values)) <= ramp.velocity * (1 + ROUNDING)
        assert max(map(abs, slopes)) <= steepest * (1 + 1e-6)
        for before, after in pairwise([0.0, *slopes]):
            assert abs(after - before) <= ramp.jerk * PERIOD_S * (1 + 1e-6) + 1e-6


@given(st.one_of(limits, smooth_limits), twists, st.integers(1, 200))
def test_a_stop_takes_no_longer_than_promised(
    all_limits: TwistLimits, command: PlanarTwist, count: int
) -> None:
    limiter = TwistLimiter(all_limits, PERIOD_S)
    driven(limiter, [(command, count)])
    reached = limiter._ramp
    braking_s = max(
        abs(speed) / part.deceleration
        for speed, part in zip(reached, all_limits.parts, strict=True)
    )
    periods = math.ceil(braking_s / PERIOD_S - 1e-6) + math.ceil(
        all_limits.smoothing() / PERIOD_S - 1e-6
    )
    for _ in range(periods):
        limiter.step(ZERO_TWIST)
    assert limiter.step(ZERO_TWIST) == ZERO_TWIST
    assert limiter.at_rest


@given(st.one_of(limits, smooth_limits), twists)
def test_a_lasting_command_is_reached_exactly(
    all_limits: TwistLimits, command: PlanarTwist
) -> None:
    limiter = TwistLimiter(all_limits, PERIOD_S)
    wanted = all_limits.scaled(command)
    enough = 2 + round(10.0 / 0.1 / PERIOD_S) + round(all_limits.smoothing() / PERIOD_S)
    for _ in range(enough):
        if limiter.step(command) == wanted:
            break
    reached = limiter.step(command)
    assert reached == wanted


def test_a_fast_command_is_slowed_on_its_arc() -> None:
    all_limits = TwistLimits(RampLimits(1.0, 1.0, 1.0), RampLimits(2.0, 4.0, 4.0), 1.2, 0.275)
    assert all_limits.scaled(PlanarTwist(2.0, 1.0)) == pytest.approx(PlanarTwist(1.0, 0.5))
    assert all_limits.scaled(PlanarTwist(0.5, -8.0)) == pytest.approx(PlanarTwist(0.125, -2.0))
    rim = all_limits.scaled(PlanarTwist(1.0, 2.0))
    assert rim == pytest.approx(PlanarTwist(1.2 / 1.55, 2.4 / 1.55))


def test_sideways_counts_for_the_rims_and_has_its_own_limit() -> None:
    ramp = RampLimits(1.0, 1.0, 1.0)
    all_limits = TwistLimits(ramp, ramp, 1.5, 0.5, RampLimits(0.5, 1.0, 1.0))
    assert all_limits.scaled(PlanarTwist(1.0, 0.0, 1.0)) == pytest.approx(
        PlanarTwist(0.5, 0.0, 0.5)
    )
    rim = all_limits.scaled(PlanarTwist(1.0, 1.0, 0.5))
    assert rim == pytest.approx(PlanarTwist(0.75, 0.75, 0.375))


def test_reset_stands_still_at_once() -> None:
    smooth = RampLimits(1.0, 1.0, 1.0, 5.0)
    limiter = TwistLimiter(TwistLimits(smooth, smooth), PERIOD_S)
    driven(limiter, [(PlanarTwist(1.0, 1.0), 200)])
    assert not limiter.at_rest
    limiter.reset()
    assert limiter.at_rest
    assert limiter.step(ZERO_TWIST) == ZERO_TWIST


@given(smooth_limits, twists, st.integers(1, 60))
def test_a_ramp_that_speeds_up_no_more_goes_on_from_its_last_step(
    all_limits: TwistLimits, command: PlanarTwist, count: int
) -> None:
    limiter = TwistLimiter(all_limits, PERIOD_S)
    fastest = driven(limiter, [(command, count)])[-1]
    limiter.speed_up_no_more()
    for twist in driven(limiter, [(ZERO_TWIST, 2000)])[1:]:
        for part, limit in zip(twist, fastest, strict=True):
            assert abs(part) <= abs(limit) + ROUNDING
    assert twist == ZERO_TWIST


def test_a_stop_that_slows_down_already_goes_on() -> None:
    ramp = RampLimits(1.0, 1.0, 1.0, 20.0)
    one, other = (TwistLimiter(TwistLimits(ramp, ramp), PERIOD_S) for _ in range(2))
    for limiter in (one, other):
        driven(limiter, [(PlanarTwist(1.0, 0.0), 200), (ZERO_TWIST, 3)])
    one.speed_up_no_more()
    assert driven(one, [(ZERO_TWIST, 100)]) == driven(other, [(ZERO_TWIST, 100)])
