"""``python -m tools.endurance.stalled_tests COMMAND``: stop all its processes now and then.

As on a computer that stands still for moments: nothing runs, and time goes on. Tests have to bear
it. Processes are known by a variable that they inherit, so that those that left their session are
among them. The kernel's timers and buffers are not stopped.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
import uuid
from contextlib import suppress
from pathlib import Path

import click

MARK = "ROBOTD_STALLED"


def processes(mark: bytes) -> list[int]:
    """Return the processes that have ``mark`` in their environment."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):  # it has ended, or is somebody else's
            if mark in (folder / "environ").read_bytes():
                found.append(int(folder.name))
    return found


def stall(mark: bytes, seconds: float) -> int:
    """Stop all processes for a time; return their number."""
    stopped = processes(mark)
    try:
        send(signal.SIGSTOP, stopped)
        time.sleep(seconds)
    finally:
        send(signal.SIGCONT, stopped)
    return len(stopped)


def send(number: signal.Signals, to: list[int]) -> None:
    for process in to:
        with suppress(ProcessLookupError):
            os.kill(process, number)


@click.command(context_settings={"ignore_unknown_options": True})
@click.option("--shortest-s", default=0.3, show_default=True, help="Of a stall.")
@click.option("--longest-s", default=3.0, show_default=True)
@click.option(
    "--gap-s", nargs=2, default=(10.0, 25.0), show_default=True, help="Between two stalls."
)
@click.option("--seed", type=int, default=1, show_default=True)
@click.argument("command", nargs=-1, required=True, type=click.UNPROCESSED)
def main(
    shortest_s: float,
    longest_s: float,
    gap_s: tuple[float, float],
    seed: int,
    command: tuple[str, ...],
) -> None:
    """Run COMMAND, such as `make test-long ARGS=tests/ros`, and end with its exit status."""
    chance, mark = random.Random(seed), f"{MARK}={uuid.uuid4().hex}"
    stalls, stalled_s = 0, 0.0
    with subprocess.Popen(command, env=os.environ | dict([mark.split("=")])) as process:
        while process.poll() is None:
            with suppress(subprocess.TimeoutExpired):
                process.wait(chance.uniform(*gap_s))
            seconds = chance.uniform(shortest_s, longest_s)
            if process.poll() is None and stall(mark.encode(), seconds):
                stalls, stalled_s = stalls + 1, stalled_s + seconds
    click.echo(f"{stalls} stalls, {stalled_s:.0f} s in all", err=True)
    sys.exit(process.returncode)


if __name__ == "__main__":
    main()
