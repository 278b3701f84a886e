"""Print what drives are asked for after a silence in the middle of a path.

``python -m tests.witness.silences [CASE ...]``
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import Any

from tests.witness.bench import Bench
from tests.witness.canopen_bench import CanopenBench
from tests.witness.ethercat_bench import EthercatBench

from robotd.errors import RobotdError
from robotd.motion import TrajectoryRequest

TRAVEL_RAD = 2.4
SILENCES_S = (0.006, 0.014, 0.025, 0.065, 0.205, 0.4)
SPEEDS_RAD_S = (1.0, 3.0)
PATIENT = {"stale_after_s": 1.0}


def silence_in_a_path(
    bench: Bench, speed: float, seconds: float, axes: Sequence[int] = (0,), how: str = "both"
) -> tuple[str, str]:
    """Follow a path of both joints in which drives are silent, all without axes.

    Returns outcome and message of the path.
    """
    request = TrajectoryRequest.from_rows(
        bench.robot.joint_names, [1.5 * TRAVEL_RAD / speed], [[TRAVEL_RAD / 2, -TRAVEL_RAD / 2]]
    )
    with bench.requested():
        bench.robot.start()
    start = TrajectoryRequest.from_rows(
        bench.robot.joint_names, [1.0], [[-TRAVEL_RAD / 2, TRAVEL_RAD / 2]]
    )
    finish(bench, start)
    for judge in bench.judges:
        judge.peaks.velocity = judge.peaks.acceleration = 0.0
    elapsed_s = 0.6 * TRAVEL_RAD / speed
    outcome = finish(bench, request, elapsed_s, lambda: bench.silence(seconds, axes, how))
    bench.run(1.0)
    bench.robot.shutdown()
    return outcome


def finish(
    bench: Bench,
    request: TrajectoryRequest,
    elapsed_s: float = 0.0,
    then: Callable[[], None] = lambda: None,
) -> tuple[str, str]:
    """Follow a path to its end, with ``then`` after a time; return outcome and message."""
    with bench.robot.follower.follow(request) as execution:
        bench.run(elapsed_s)
        then()
        while not execution.done:
            bench.run(0.01)
    return str(execution.outcome), execution.message


def canopen(*, patient: bool, **robot: Any) -> Bench:
    return CanopenBench(engine=PATIENT if patient else {}, **robot)


def ethercat(*, patient: bool, **robot: Any) -> Bench:
    """Return a bench whose slaves are patient, too: else their watchdogs end a silence."""
    section = {"max_lost_frames": 100, "watchdog_ms": 1000.0} if patient else {}
    return EthercatBench(engine=PATIENT if patient else {}, section=section, **robot)


CASES: dict[str, tuple[Callable[..., Bench], Sequence[int]]] = {
    "canopen": (canopen, [0]),
    "canopen-bus": (canopen, []),
    "ethercat": (ethercat, [0]),
    "ethercat-bus": (ethercat, []),
}
"""Robots, and the axes whose drives are silent; all without axes."""


def main(names: list[str]) -> None:
    for name in names or list(CASES):
        make, axes = CASES[name]
        for patient in (False, True):
            for seconds in SILENCES_S:
                for speed in SPEEDS_RAD_S:
                    bench = make(patient=patient)
                    try:
                        outcome, _ = silence_in_a_path(bench, speed, seconds, axes)
                    except RobotdError as error:
                        outcome = type(error).__name__ + " " + str(error)[:60]
                        bench.robot.shutdown()
                    bench.close()
                    asked = max(judge.peaks.velocity for judge in bench.judges)
                    hard = max(judge.peaks.acceleration for judge in bench.judges)
                    limits = "patient" if patient else "default"
                    line = f"{name:12} {limits} limits, {seconds:5.3f} s at {speed:g} rad/s: "
                    text = f"{asked:6.1f} rad/s {hard:8.0f} rad/s²  {outcome:22} "
                    print(line + text, len(bench.findings) or "right", flush=True)  # noqa: T201
                    for finding in bench.findings[:2]:
                        print("            " + finding, flush=True)  # noqa: T201


if __name__ == "__main__":
    main(sys.argv[1:])
