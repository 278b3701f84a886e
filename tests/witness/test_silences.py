"""A path waits for a drive that is silent; what it gets after that is within its limits."""

from __future__ import annotations

import pytest
from tests.witness.silences import CASES, silence_in_a_path

# Seconds, rad/s, and limits of loss that leave time; `tests.witness.silences` tries all of them.
SILENCES = [(0.025, 3.0, False), (0.065, 1.0, True), (0.205, 3.0, False), (0.4, 1.0, True)]


@pytest.mark.parametrize(("seconds", "speed", "patient"), SILENCES)
@pytest.mark.parametrize("case", CASES)
def test_a_drive_that_was_silent_gets_no_step(
    case: str, seconds: float, speed: float, patient: bool
) -> None:
    make, axes = CASES[case]
    bench = make(patient=patient)
    try:
        silence_in_a_path(bench, speed, seconds, axes)
    finally:
        bench.close()
    assert bench.findings == []


@pytest.mark.parametrize("seconds", [0.006, 0.014, 0.1])
@pytest.mark.parametrize("case", CASES)
def test_a_wheel_that_was_silent_in_a_ramp_gets_no_step(case: str, seconds: float) -> None:
    make, axes = CASES[case]
    bench = make(patient=True, axes=1, base=True)
    try:
        with bench.requested():
            bench.robot.start()
        base = bench.robot.base
        assert base is not None
        base.command(1.0, 0.0, timeout_s=10.0)
        bench.run(0.2)
        bench.silence(seconds, [1] if axes else [])
        bench.run(1.0)
        assert base.twist(bench.robot.image).linear == pytest.approx(1.0, abs=1e-3)
        bench.robot.shutdown()
    finally:
        bench.close()
    assert bench.findings == []
