"""Cost of the recorder: ``python -m tools.bench.recorder [--seconds 20] [--robot cr3a]``.

Prints the time of one frame in the control loop, the lateness without a recorder, with it, while a
snapshot is written and while everything is recorded, and the size of the files.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from tools.bench.tables import target_lines
from tools.bench.targets import at_most

from robotd.log import configure_logging
from robotd.motion import TrajectoryRequest
from robotd.observation.period_writer import period_writer
from robotd.observation.tap import Tap
from robotd.robot import Robot, build_robot
from robotd_recorder.recorder import observed


def move(robot: Robot, seconds: float) -> None:
    """Let the joints go to and fro, so that all values change."""
    goal = 0.3 if float(robot.image.position_command[0]) < 0.15 else 0.0
    rows = [[goal] * len(robot.joint_names)]
    request = TrajectoryRequest.from_rows(robot.joint_names, [seconds], rows)
    with robot.follower.follow(request) as execution:
        execution.wait(seconds + 5)


def timing(robot: Robot, work: Callable[[], object]) -> str:
    """Percentiles of the periods while ``work`` runs."""
    stats = robot.control_loop.stats
    first, missed, cpu = stats.cycles, stats.missed, time.process_time()
    began = time.monotonic()
    work()
    samples, count = stats.samples(), stats.cycles - first
    late = np.percentile(samples.lateness_ns[-count:], (50, 99, 100)) / 1e3
    execution = np.percentile(samples.execution_ns[-count:], (50, 99)) / 1e3
    share = (time.process_time() - cpu) / (time.monotonic() - began)
    return (
        f"late p50 {late[0]:.0f} p99 {late[1]:.0f} max {late[2]:.0f} us, execution p50"
        f" {execution[0]:.0f} p99 {execution[1]:.0f} us, {stats.missed - missed} missed,"
        f" {100 * share:.1f} % of a core"
    )


def measure(name: str, seconds: float, folder: Path) -> None:
    robot = build_robot(name, "sim")
    robot.start()
    print("without     ", timing(robot, lambda: move(robot, seconds)))
    robot.shutdown()

    robot = build_robot(name, "sim")
    with ExitStack() as stack:
        recorder = stack.enter_context(observed(robot, flight_folder=folder))
        costs = time_observer(robot)
        robot.start()
        print("with        ", timing(robot, lambda: move(robot, seconds)))
        print("snapshot    ", timing(robot, lambda: recorder.flight.snapshot("bench")))
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        recorder.continuous.start()
        print("continuously", timing(robot, lambda: move(robot, seconds)))
        report = recorder.continuous.stop()
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        robot.shutdown()
    writer_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    cost, empty = (np.percentile(np.array(cost[300:]) / 1e3, (10, 50, 90, 99)) for cost in costs)
    frames = recorder.tap.frames
    print("one frame    p10 {:.1f} p50 {:.1f} p90 {:.1f} p99 {:.1f} us, of which".format(*cost))
    print("the clock    p10 {:.1f} p50 {:.1f} p90 {:.1f} p99 {:.1f} us".format(*empty))
    print(f"memory       {frames.nbytes / 2**20:.1f} MiB of frames, {frames.capacity} frames")
    print(f"snapshot     {(recorder.flight.last or folder).stat().st_size / 2**20:.2f} MiB")
    rate = report.size_bytes / 2**20 / seconds * 60
    print(f"continuously {rate:.1f} MiB a minute, {100 * writer_s / seconds:.1f} % of a core")
    print(f"lost frames  {report.lost_frames}")
    used_mib = (recorder.tap.nbytes) / 2**20
    net_us = [float(np.median(cost[300:])) / 1e3 for cost in costs]
    rows = [
        at_most(
            "a frame in the control loop, p50 without the clock", net_us[0] - net_us[1], 5, "µs"
        ),
        at_most("a frame in a tight loop, p50", tight_loop_us(robot), 5, "µs"),
        at_most("memory of the recorder", used_mib, 24, "MiB"),
    ]
    for line in target_lines(rows):
        print(line)


def tight_loop_us(robot: Robot) -> float:
    """Median cost of one frame with warm caches."""
    tap = Tap(robot, 30.0)
    write, costs, clock = period_writer(robot, tap.frames, tap._io), [], time.perf_counter_ns
    for _ in range(10_000):
        began = clock()
        write()
        costs.append(clock() - began)
    return float(np.median(costs)) / 1e3


def time_observer(robot: Robot) -> tuple[list[int], list[int]]:
    """Time calls of the control loop's observer, and of an empty one in between; ns."""
    observer = robot.control_loop._observer
    costs: list[int] = []
    empty: list[int] = []
    assert observer is not None
    clock = time.perf_counter_ns

    def nothing() -> None:
        """Take the place of the observer in every other period."""

    def timed() -> None:
        is_real = len(costs) <= len(empty)
        call = observer if is_real else nothing
        began = clock()
        call()
        (costs if is_real else empty).append(clock() - began)

    robot.control_loop.observe(timed)
    return costs, empty


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--robot", default="cr3a")
    options = parser.parse_args()
    configure_logging("error")
    with tempfile.TemporaryDirectory() as directory:
        measure(options.robot, options.seconds, Path(directory))
