import math

from hypothesis import given
from hypothesis import strategies as st

from robotd_cia402.options import DriveOptions
from robotd_cia402.scaling import SPAN, Scaling, wrapped


def scaling(polarity: int = 1, rated: float | None = None) -> Scaling:
    options = DriveOptions(axis=0, counts_per_rad=1000.0, polarity=polarity)
    return Scaling(options, rated)


@given(st.integers(-(2**40), 2**40))
def test_wrapping_keeps_the_low_bits_and_fits(counts: int) -> None:
    assert -(2**31) <= wrapped(counts) < 2**31
    assert (wrapped(counts) - counts) % SPAN == 0


@given(st.floats(-1e4, 1e4), st.sampled_from([1, -1]))
def test_positions_come_back_within_half_a_count(position: float, polarity: int) -> None:
    mine = scaling(polarity)
    assert abs(mine.counts(position) * mine.position - position) <= 0.5e-3 + 1e-9


def test_polarity_turns_every_quantity() -> None:
    mine = scaling(-1, rated=50.0)
    assert mine.counts(1.0) == -1000
    assert mine.velocity_units(0.5) == -500
    assert mine.torque == -0.05
    assert mine.ramp_units(2.0) == 2000


def test_torque_without_a_rating_is_unknown() -> None:
    assert math.isnan(scaling().torque)
