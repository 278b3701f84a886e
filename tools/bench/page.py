"""Cost of the live page: ``python -m tools.bench.page [--seconds 5] [--rounds 4]``.

Prints the processor time of the robot's process and the lateness of its control loop without a
page, and with one that nobody, one viewer and five viewers watch. The joints move. Rounds are
interleaved and the medians printed, because the computer may be busy.
"""

from __future__ import annotations

import argparse
import asyncio
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import aiohttp
import numpy as np
from tools.bench.recorder import move

from robotd.log import configure_logging
from robotd.observation.recorder import Recorder, observed
from robotd.page.page_server import PageServer
from robotd.page.robot_source import RobotSource
from robotd.robot import Robot, build_robot

CASES = ("no page", "nobody", "1 viewer", "5 viewers")
VIEWERS = {"1 viewer": 1, "5 viewers": 5}


async def watch(url: str) -> None:
    """Receive until the connection ends; print a line when it stands."""
    async with aiohttp.ClientSession() as session, session.ws_connect(f"{url}ws") as viewer:
        await viewer.receive()
        print("watching", flush=True)
        async for _ in viewer:
            pass


@contextmanager
def watched(url: str, count: int) -> Iterator[None]:
    """Let ``count`` processes watch the page."""
    command = [sys.executable, "-m", "tools.bench.page", "--watch", url]
    viewers = [subprocess.Popen(command, stdout=subprocess.PIPE) for _ in range(count)]
    try:
        for viewer in viewers:
            assert viewer.stdout is not None
            viewer.stdout.readline()
        time.sleep(0.5)
        yield
    finally:
        for viewer in viewers:
            viewer.kill()
            viewer.communicate()


def measure(robot: Robot, seconds: float) -> tuple[float, float, float]:
    """Share of a core in percent; lateness p50 and p99 in us."""
    stats = robot.control_loop.stats
    first, used_s, began_s = stats.cycles, time.process_time(), time.monotonic()
    move(robot, seconds)
    share = 100 * (time.process_time() - used_s) / (time.monotonic() - began_s)
    count = stats.cycles - first
    late = np.percentile(stats.samples().lateness_ns[-count:], (50, 99)) / 1e3
    return share, float(late[0]), float(late[1])


def measure_case(
    case: str, recorder: Recorder, robot: Robot, seconds: float
) -> tuple[float, float, float]:
    if case == "no page":
        return measure(robot, seconds)
    with (
        PageServer(RobotSource(recorder.tap, robot.descriptor.nodes), 0) as page,
        watched(page.url, VIEWERS.get(case, 0)),
    ):
        return measure(robot, seconds)


def main(name: str, seconds: float, rounds: int) -> None:
    robot = build_robot(name, "sim")
    found: dict[str, list[tuple[float, float, float]]] = {case: [] for case in CASES}
    with (
        tempfile.TemporaryDirectory() as folder,
        observed(robot, flight_folder=Path(folder)) as recorder,
    ):
        robot.start()
        for _ in range(rounds):
            for case in CASES:
                found[case].append(measure_case(case, recorder, robot, seconds))
        robot.shutdown()
    base = [each[0] for each in found[CASES[0]]]
    for case in CASES:
        share, p50, p99 = (statistics.median(column) for column in zip(*found[case], strict=True))
        more = statistics.median(
            each[0] - without for each, without in zip(found[case], base, strict=True)
        )
        print(
            f"{case:10} {share:5.1f} % of a core, {more:+5.1f} % against no page,"
            f" late p50 {p50:.0f} p99 {p99:.0f} us"
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--rounds", type=int, default=4)
    parser.add_argument("--robot", default="cr3a")
    parser.add_argument("--watch", metavar="URL", help="be a viewer")
    options = parser.parse_args()
    configure_logging("error")
    if options.watch:
        asyncio.run(watch(options.watch))
    else:
        main(options.robot, options.seconds, options.rounds)
