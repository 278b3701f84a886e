"""Cost of ``robotd page``: ``python -m tools.bench.remote_page [--seconds 8]``.

Prints the processor time of the robot's process and of the one of the page, both at rest: without
the page, with nobody watching, and with one viewer.
"""

from __future__ import annotations

import argparse
import asyncio
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from tests.features.page.server.viewer import connected, listed
from tools.bench.process import Program, fresh_environment

from robotd_testing.domain import own_domain

ROBOT = [sys.executable, "-m", "robotd", "run", "--robot", "cr3a", "--backend", "sim"]
PAGE = [sys.executable, "-m", "robotd", "page", "0"]


async def watch(url: str) -> None:
    """Be a viewer of the robot; print a line when it is shown."""
    await listed(url, "/")
    async with connected(url, "/") as viewer:
        print("watching", flush=True)
        await viewer.until(lambda: False)


@contextmanager
def watched(url: str) -> Iterator[None]:
    command = [sys.executable, "-m", "tools.bench.remote_page", "--watch", url]
    viewer = subprocess.Popen(command, stdout=subprocess.PIPE)
    assert viewer.stdout is not None
    viewer.stdout.readline()
    try:
        yield
    finally:
        viewer.kill()
        viewer.communicate()


def shares(seconds: float, *programs: Program) -> list[str]:
    """Share of a core of each process, in percent."""
    time.sleep(1.0)
    used_s, began_s = [each.cpu_s() for each in programs], time.monotonic()
    time.sleep(seconds)
    passed_s = time.monotonic() - began_s
    pairs = zip(programs, used_s, strict=True)
    return [f"{100 * (each.cpu_s() - before_s) / passed_s:5.1f} %" for each, before_s in pairs]


def main(seconds: float) -> None:
    with own_domain() as domain:
        environment = fresh_environment(domain)
        with Program(ROBOT, environment, started="ready after") as robot:
            print("no page       robot", *shares(seconds, robot))
            with Program(PAGE, environment, started="stop with Ctrl-C") as page:
                match = re.search(r"http://\S+/", page.output)
                assert match
                print("nobody        robot and page", *shares(seconds, robot, page))
                with watched(match[0]):
                    print("one viewer    robot and page", *shares(seconds, robot, page))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=8.0)
    parser.add_argument("--watch", metavar="URL", help="be a viewer")
    options = parser.parse_args()
    if options.watch:
        asyncio.run(watch(options.watch))
    else:
        main(options.seconds)
