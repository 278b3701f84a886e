"""Cost of the live page: ``python -m tools.bench.page [--seconds 4] [--rounds 6]``.

Measures the robot's process with a page that nobody, one viewer and five viewers watch, and five
tabs of Chromium where it is installed (they compute on the same cores). The joints move. Each
window is compared with one without a page just before it; the medians of these differences and
ratios are printed with their quartiles, because a process takes 1 % of a core more or less from
window to window. The clocks of the threads show what the page's own take, without that noise.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import aiohttp
import numpy as np
from tests.features.page.server.browser import CHROMIUM, NO_WEBGL, chromium, open_page
from tools.bench.recorder import move
from tools.bench.tables import target_lines
from tools.bench.targets import Target, at_most

from robotd.log import configure_logging
from robotd.robot import Robot, build_robot
from robotd_page.page_feed import RobotSource
from robotd_page.page_server import BUNDLE_FOLDER, PageServer
from robotd_recorder.recorder import Recorder, observed

CASES = ("nobody", "1 viewer", "5 viewers")
TABS = "5 tabs"
VIEWERS = {"1 viewer": 1, "5 viewers": 5}
LIMITS = {"1 viewer": 2.0, "5 viewers": 5.0, TABS: 5.0}  # percent of a core
LATENESS = 1.1  # of that without a page
PAGE_THREADS = "robotd-page"
CONTROL_THREAD = "robotd-control"


class Window(NamedTuple):
    """Shares of a core in percent, and lateness of the control loop in us."""

    process: float
    page: float
    control: float
    late_p50: float
    late_p99: float


Pair = tuple[Window, Window]
"""A window without a page, and the one with it that followed."""


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


def thread_s(name: str) -> float:
    """Return the processor time of the threads whose names begin with ``name``."""
    clocks = [
        time.pthread_getcpuclockid(thread.ident)
        for thread in threading.enumerate()
        if thread.ident is not None and thread.name.startswith(name)
    ]
    return sum(map(time.clock_gettime, clocks))


def used_s() -> np.ndarray:
    """Return the processor time of the process, the page's threads and the control loop."""
    return np.array([time.process_time(), thread_s(PAGE_THREADS), thread_s(CONTROL_THREAD)])


def measure(robot: Robot, seconds: float) -> Window:
    """Measure while the joints move."""
    stats = robot.control_loop.stats
    first, before_s, began_s = stats.cycles, used_s(), time.monotonic()
    move(robot, seconds)
    shares = 100 * (used_s() - before_s) / (time.monotonic() - began_s)
    count = stats.cycles - first
    late = np.percentile(stats.samples().lateness_ns[-count:], (50, 99)) / 1e3
    return Window(*shares.tolist(), *late.tolist())


def measure_pair(case: str, recorder: Recorder, robot: Robot, seconds: float) -> Pair:
    """Measure without a page, then with it."""
    without = measure(robot, seconds)
    source = RobotSource(recorder.tap, robot.descriptor.nodes)
    with PageServer(source, 0) as page, watched(case, page.url):
        return without, measure(robot, seconds)


def main(name: str, seconds: float, rounds: int) -> None:
    has_browser = CHROMIUM is not None and (BUNDLE_FOLDER / "page.js").is_file()
    cases = (*CASES, TABS) if has_browser else CASES
    robot = build_robot(name, "sim")
    found: dict[str, list[Pair]] = {case: [] for case in cases}
    with (
        tempfile.TemporaryDirectory() as folder,
        observed(robot, flight_folder=Path(folder)) as recorder,
    ):
        robot.start()
        for _ in range(rounds):
            for case in cases:
                found[case].append(measure_pair(case, recorder, robot, seconds))
        robot.shutdown()
    print(f"load {os.getloadavg()[0]:.1f}, {rounds} pairs of windows of {seconds:g} s each")
    for line in report(found):
        print(line)


def report(found: dict[str, list[Pair]]) -> Iterator[str]:
    """Yield a line for each case, and the targets."""
    rows: list[Target] = []
    for case, pairs in found.items():
        without, window = (
            Window(*np.median(windows, axis=0)) for windows in zip(*pairs, strict=True)
        )
        more = quartiles([after.process - before.process for before, after in pairs])
        ratio = quartiles([after.late_p99 / before.late_p99 for before, after in pairs])
        yield (
            f"{case:10} threads of the page {window.page:.2f} % of a core; process"
            f" {without.process:.1f} to {window.process:.1f} %, {more[1]:+.1f} %"
            f" ({more[0]:+.1f} to {more[2]:+.1f}); control loop {without.control:.1f} to"
            f" {window.control:.1f} %; late p50 {without.late_p50:.0f} to {window.late_p50:.0f} us,"
            f" p99 {without.late_p99:.0f} to {window.late_p99:.0f} us,"
            f" × {ratio[1]:.2f} ({ratio[0]:.2f} to {ratio[2]:.2f})"
        )
        if case in LIMITS:
            rows.append(at_most(f"process, {case}", more[1], LIMITS[case], "% of a core"))
            rows.append(at_most(f"threads, {case}", window.page, LIMITS[case], "% of a core"))
            if case != TABS:  # these compute on the cores of the robot
                rows.append(at_most(f"lateness p99 to no page, {case}", ratio[1], LATENESS))
    yield from target_lines(rows)


def quartiles(values: Sequence[float]) -> list[float]:
    """Return the lower quartile, the median and the upper quartile."""
    return [float(quartile) for quartile in np.percentile(values, (25, 50, 75))]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--rounds", type=int, default=6)
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
