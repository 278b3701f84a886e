"""Leak check of repeated programs, with a leak and without."""

from __future__ import annotations

import pytest
from tools.endurance.repeats import leaks, repeat

from robotd_teach.programs import Programs

TIMES = 200


@pytest.fixture(autouse=True)
def short_log(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robotd.events.MAX_BYTES", 2**16)  # full after one run


@pytest.mark.long
def test_a_repeated_program_leaks_nothing() -> None:
    assert list(leaks([*repeat(TIMES)], TIMES)) == []


@pytest.mark.long
def test_one_object_kept_after_each_run_is_found() -> None:
    kept: list[object] = []

    def keep(programs: Programs) -> None:
        kept.append(programs.state)

    found = list(leaks([*repeat(TIMES, keep)], TIMES))
    assert "10 more objects robotd_teach.programs.ProgramState after 10 runs" in found


@pytest.mark.long
def test_what_the_garbage_collector_does_not_track_is_found_as_blocks() -> None:
    kept: list[object] = []
    looks = [*repeat(TIMES, lambda _: kept.extend([object(), object()]))]
    found = list(leaks(looks, TIMES))
    assert len(found) == 1
    assert "more blocks of memory after 10 runs" in found[0]
