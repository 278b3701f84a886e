"""The search of a homing, along a line with switches."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotd_cia402.simulated.homing_search import METHODS, Phase, Search
from robotd_cia402.simulated.scale import Switches

SWITCHES = Switches(negative_limit=-1.0, positive_limit=1.0, home=0.5, home_width=0.1)
FAST, CREEP, STEP_S = 0.5, 0.05, 0.02
STEPS = 5000
EDGES = {17: -1.0, 18: 1.0, 19: 0.45, 21: 0.55, 23: 0.45, 27: 0.55}


def run(method: int, position: float) -> tuple[Phase, float]:
    """Run a search from ``position``; return its end."""
    search = Search(METHODS[method], FAST, CREEP)
    for _ in range(STEPS):
        search.step(SWITCHES.inputs(position))
        if search.phase in (Phase.FOUND, Phase.FAILED):
            return search.phase, position
        position += search.velocity * STEP_S
    raise AssertionError("the search does not end")


@pytest.mark.parametrize("method", [17, 18, 23, 27])
@given(position=st.floats(-0.95, 0.95))
def test_home_is_found_from_everywhere(method: int, position: float) -> None:
    phase, found = run(method, position)
    assert phase is Phase.FOUND
    assert found == pytest.approx(EDGES[method], abs=2 * CREEP * STEP_S)


@pytest.mark.parametrize(("method", "good", "bad"), [(19, 0.0, 0.8), (21, 0.8, 0.0)])
def test_without_a_turn_only_from_the_right_side(method: int, good: float, bad: float) -> None:
    assert run(method, good)[1] == pytest.approx(EDGES[method], abs=2 * CREEP * STEP_S)
    assert run(method, bad)[0] is Phase.FAILED
