"""A goal that succeeds is where it was asked for, also after setpoints were late on their way."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from tests.witness.one_by_one import one_by_one
from tests.witness.silences import finish
from tests.witness.wmx_bench import WmxBench

from robotd.control.loop.setpoint_source import Outcome
from robotd.motion import TrajectoryRequest

GOAL_RAD, DURATION_S = 0.1, 0.5
MAX_ERROR_RAD = 1e-5
Fault = Callable[[WmxBench], None]
FAULTS: dict[str, Fault] = {
    "process stalls 30 ms": lambda bench: bench.stall(0.03),
    "process stalls 60 ms": lambda bench: bench.stall(0.06),
    "sender stalls 60 ms": lambda bench: bench.silence(0.06, how="commands"),
    "sender stalls 120 ms": lambda bench: bench.silence(0.12, how="commands"),
}


@pytest.mark.parametrize("begin_s", [0.3, 0.42, 0.48])
@pytest.mark.parametrize("fault", FAULTS)
def test_a_goal_that_succeeds_is_reached_by_the_commands(fault: str, begin_s: float) -> None:
    """The buffer runs dry, and its deviation from the path has to end before the goal does."""
    with one_by_one():
        bench = WmxBench(rate_hz=250.0, stream_buffer_s=0.03)
        try:
            with bench.requested():
                bench.robot.start()
            request = TrajectoryRequest.from_rows(
                bench.robot.joint_names, [DURATION_S], [[GOAL_RAD, -GOAL_RAD]]
            )
            outcome, message = finish(bench, request, begin_s, lambda: FAULTS[fault](bench))
            reached = bench.robot.image.position_command.tolist()
            bench.robot.shutdown()
        finally:
            bench.close()
    assert outcome == str(Outcome.SUCCEEDED), message
    assert reached == pytest.approx([GOAL_RAD, -GOAL_RAD], abs=MAX_ERROR_RAD)
    assert bench.findings == []
