"""Programs that leave little to others: ``python -m tools.endurance.hog KIND``, until ended."""

from __future__ import annotations

import contextlib
import mmap
import os

import click
import numpy as np

REALTIME = 5  # below the priorities that robots ask for
MEMORY_SHARE = 0.8  # of what is available
MEMORY_MOST = 8 * 2**30


def burn() -> None:
    """Use one core, for ever."""
    while True:
        pass


def fill() -> None:
    """Take memory and keep touching it."""
    pages = os.sysconf("SC_AVPHYS_PAGES") * mmap.PAGESIZE
    block = np.zeros(min(MEMORY_MOST, int(pages * MEMORY_SHARE)), np.uint8)
    click.echo("hogging")
    while True:
        block[:: mmap.PAGESIZE] += 1


@click.command()
@click.argument("kind", type=click.Choice(["cpu", "realtime", "memory"]))
def main(kind: str) -> None:
    """Hog one core, one core with real-time priority, or memory."""
    if kind == "realtime":
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(REALTIME))
    if kind == "memory":
        with contextlib.suppress(KeyboardInterrupt):
            fill()
    click.echo("hogging")
    burn()


if __name__ == "__main__":
    main()
