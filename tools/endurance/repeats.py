"""Leak check: a short program, repeated many times on the simulation in simulated time."""

from __future__ import annotations

import gc
import os
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import click
from tools.endurance.vitals import Vitals, vitals

from robotd import Robot, open_robot
from robotd.api.robots import SteppedClock
from robotd_teach.program_code import Program
from robotd_teach.programs import Programs

ROBOT = "extends: cr3a\nname: arm\nposes: poses.yaml\ncycle: {rate_hz: 100}\n"
IN_A_RUN = 10  # times that the steps are repeated in one run of the program
LOOKS = 10
MAX_GROWTH_MIB = 1.0  # of resident memory in the last half
PROGRAM = Program.parse(f"""
speed: 1.0
steps:
  - move:
      joints: {{joint1: 0.0, joint2: 0.3, joint3: 1.4, joint4: 0.0, joint5: 1.2, joint6: 0.0}}
  - line: {{by: {{z: 0.001}}}}
  - repeat:
      times: {IN_A_RUN}
      steps:
        - move: {{joints: {{joint1: 0.001}}}}
        - output: {{name: 0.1, on: true}}
        - wait: {{time_s: 0.01}}
        - move: {{joints: {{joint1: 0.0}}}}
        - output: {{name: 0.1, on: false}}
        - if: {{input: 0.3, steps: [{{message: on}}], else: [{{message: off}}]}}
""")


@dataclass(frozen=True)
class Look:
    """Contents of this process.

    Attributes:
        vitals: as the kernel reports them.
        objects: number of objects that the garbage collector tracks, by type.
        blocks: number of blocks that Python has allocated, without those of the looks before.
    """

    vitals: Vitals
    objects: Counter[str]
    blocks: int


def blocks_in_use() -> int:
    """Return the number of blocks that Python has allocated, after a garbage collection."""
    sys._clear_type_cache()  # of names that were looked up; it fills for long
    gc.collect()
    return sys.getallocatedblocks()


def objects_by_type() -> Counter[str]:
    """Return the number of objects that the garbage collector tracks."""
    types = (type(item) for item in gc.get_objects())
    return Counter(f"{kind.__module__}.{kind.__qualname__}" for kind in types)


def repeat(
    times: int, after_run: Callable[[Programs], None] = lambda programs: None
) -> Iterator[Look]:
    """Yield looks at even distances, the last one at the end.

    The first run begins when the log of events is full: until then it grows.

    Args:
        times: number of repeats, a multiple of ``IN_A_RUN`` times ``LOOKS``.
        after_run: called after each run.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "robot.yaml")
        file.write_text(ROBOT, encoding="utf-8")
        with open_robot(file, "sim", clock=SteppedClock()) as robot:
            programs = robot.feature(Programs)
            while _held_events(robot) == robot.events.added:
                programs.run(PROGRAM)
            own_blocks = 0  # of the looks
            for _ in range(LOOKS):
                for _ in range(times // IN_A_RUN // LOOKS):
                    programs.run(PROGRAM)
                    after_run(programs)
                blocks = blocks_in_use()
                found = Look(vitals(os.getpid()), objects_by_type(), blocks - own_blocks)
                own_blocks += blocks_in_use() - blocks
                yield found


def leaks(looks: Sequence[Look], times: int) -> Iterator[str]:
    """Yield what grew in the last half of ``times`` repeats: by one in each run, or more."""
    before, after = looks[len(looks) // 2 - 1], looks[-1]
    runs = times // IN_A_RUN // 2
    for kind, number in (after.objects - before.objects).items():
        if number >= runs:
            yield f"{number} more objects {kind} after {runs} runs"
    if (blocks := after.blocks - before.blocks) >= runs:
        yield f"{blocks} more blocks of memory after {runs} runs"
    if (grown := after.vitals.rss_mib - before.vitals.rss_mib) > MAX_GROWTH_MIB:
        yield f"{grown:.2f} MiB more resident memory, at most {MAX_GROWTH_MIB:g} MiB"
    for what in ("threads", "fds"):
        first, last = getattr(before.vitals, what), getattr(after.vitals, what)
        if last > first:
            yield f"{last} {what}, {first} before"


def _held_events(robot: Robot) -> int:
    return len(robot.events.since(0)[0])


@click.command()
@click.option("--times", default=10_000, show_default=True, help="Multiple of 100.")
@click.option("--leak", is_flag=True, help="Keep the state after each run: it has to be found.")
def main(times: int, leak: bool) -> None:
    """Repeat a short program on the simulation; status 1 where the process holds more and more."""
    kept: list[object] = []
    looks = []
    found_looks = repeat(times, lambda programs: kept.append(programs.state) if leak else None)
    for number, found in enumerate(found_looks, 1):
        looks.append(found)
        process = found.vitals
        click.echo(
            f"{times * number // LOOKS:6d} times: {process.rss_mib:7.2f} MiB,"
            f" {process.threads} threads, {process.fds} files,"
            f" {found.objects.total()} objects, {found.blocks} blocks, {process.cpu_s:.0f} s of CPU"
        )
    findings = list(leaks(looks, times))
    for finding in findings:
        click.echo(f"leak: {finding}")
    sys.exit(1 if findings else 0)


if __name__ == "__main__":
    main()
