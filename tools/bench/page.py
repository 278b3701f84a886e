"""Cost of the live page: ``python -m tools.bench.page [--seconds 5] [--rounds 4]``.

Prints the processor time of the robot's process and the lateness of its control loop without a
page, and with one that nobody, one viewer and five viewers watch, and five tabs of Chromium where
it is installed (they compute on the same cores). The joints move. Rounds are interleaved and the
medians printed, because the computer may be busy.
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
from tests.page.browser import CHROMIUM, NO_WEBGL, chromium, open_page
from tools.bench.recorder import move
from tools.bench.tables import target_lines
from tools.bench.targets import Target, at_most

from robotd.log import configure_logging
from robotd.observation.recorder import Recorder, observed
from robotd.page.page_server import BUNDLE_FOLDER, PageServer
from robotd.page.robot_source import RobotSource
from robotd.robot import Robot, build_robot

CASES = ("no page", "nobody", "1 viewer", "5 viewers")
TABS = "5 tabs"
VIEWERS = {"1 viewer": 1, "5 viewers": 5}
LIMITS = {"1 viewer": 2.0, "5 viewers": 5.0, TABS: 5.0}  # percent of a core
LATENESS = 1.1  # of that without a page

Figures = tuple[float, float, float]
"""Share of a core in percent; lateness p50 and p99 in us."""


async def watch(url: str) -> None:
    """Receive until the connection ends; print a line when it is made."""
    async with aiohttp.ClientSession() as session, session.ws_connect(f"{url}ws") as viewer:
        await viewer.receive()
        print("watching", flush=True)
        async for _ in viewer:
            pass


def watch_in_tabs(url: str, count: int) -> None:
    """Open tabs in Chromium and leave them open; print a line when all show the robot.

    They do not draw in 3D, which a computer without a graphics card does with its processor.
    """
    with chromium() as browser:
        tabs = [open_page(browser, []) for _ in range(count)]
        for tab in tabs:
            tab.add_init_script(NO_WEBGL)
            tab.goto(url)
            tab.locator("body[data-connected=yes]").wait_for()
        print("watching", flush=True)
        tabs[0].wait_for_timeout(3_600_000)


@contextmanager
def watched(case: str, url: str) -> Iterator[None]:
    """Let the viewers of a case watch the page, in processes of their own."""
    option, count = ("--tabs", 1) if case == TABS else ("--watch", VIEWERS.get(case, 0))
    command = [sys.executable, "-m", "tools.bench.page", option, url]
    viewers = [subprocess.Popen(command, stdout=subprocess.PIPE) for _ in range(count)]
    try:
        for viewer in viewers:
            assert viewer.stdout is not None
            if not viewer.stdout.readline():
                raise RuntimeError(f"{case}: a viewer has ended")
        time.sleep(0.5)
        yield
    finally:
        for viewer in viewers:
            viewer.terminate()
            viewer.communicate()


def measure(robot: Robot, seconds: float) -> Figures:
    stats = robot.control_loop.stats
    first, used_s, began_s = stats.cycles, time.process_time(), time.monotonic()
    move(robot, seconds)
    share = 100 * (time.process_time() - used_s) / (time.monotonic() - began_s)
    count = stats.cycles - first
    late = np.percentile(stats.samples().lateness_ns[-count:], (50, 99)) / 1e3
    return share, float(late[0]), float(late[1])


def measure_case(case: str, recorder: Recorder, robot: Robot, seconds: float) -> Figures:
    if case == "no page":
        return measure(robot, seconds)
    source = RobotSource(recorder.tap, robot.descriptor.nodes)
    with PageServer(source, 0) as page, watched(case, page.url):
        return measure(robot, seconds)


def main(name: str, seconds: float, rounds: int) -> None:
    has_browser = CHROMIUM is not None and (BUNDLE_FOLDER / "page.js").is_file()
    cases = (*CASES, TABS) if has_browser else CASES
    robot = build_robot(name, "sim")
    found: dict[str, list[Figures]] = {case: [] for case in cases}
    with (
        tempfile.TemporaryDirectory() as folder,
        observed(robot, flight_folder=Path(folder)) as recorder,
    ):
        robot.start()
        for _ in range(rounds):
            for case in cases:
                found[case].append(measure_case(case, recorder, robot, seconds))
        robot.shutdown()
    for line in report(found):
        print(line)


def report(found: dict[str, list[Figures]]) -> Iterator[str]:
    """Yield a line for each case, and the targets."""
    rows: list[Target] = []
    for case, figures in found.items():
        share, p50, p99 = (statistics.median(column) for column in zip(*figures, strict=True))
        pairs = [*zip(figures, found[CASES[0]], strict=True)]
        more = statistics.median(each[0] - without[0] for each, without in pairs)
        ratio = statistics.median(each[2] / without[2] for each, without in pairs)
        yield (
            f"{case:10} {share:5.1f} % of a core, {more:+5.1f} % against no page,"
            f" late p50 {p50:.0f} p99 {p99:.0f} us, p99 × {ratio:.2f}"
        )
        if case in LIMITS:
            rows.append(at_most(f"processor, {case}", more, LIMITS[case], "% of a core"))
            if case != TABS:  # these compute on the cores of the robot
                rows.append(at_most(f"lateness p99 to no page, {case}", ratio, LATENESS))
    yield from target_lines(rows)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--rounds", type=int, default=4)
    parser.add_argument("--robot", default="cr3a")
    parser.add_argument("--watch", metavar="URL", help="be a viewer")
    parser.add_argument("--tabs", metavar="URL", help="be five tabs of Chromium")
    options = parser.parse_args()
    configure_logging("error")
    if options.watch:
        asyncio.run(watch(options.watch))
    elif options.tabs:
        watch_in_tabs(options.tabs, 5)
    else:
        main(options.robot, options.seconds, options.rounds)
