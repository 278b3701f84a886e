"""``make kill``: end robotd by signals at moments at random, many times, and start it again."""

from __future__ import annotations

import random
import signal
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, closing
from dataclasses import asdict, dataclass
from itertools import islice, product
from pathlib import Path

import click
from tests.ros.robot_process import Client
from tools.bench.machine import machine
from tools.bench.results import keep, out_option
from tools.bench.tables import aligned
from tools.endurance.lives import Life, Lives, Phase
from tools.endurance.rest import come_to_rest
from tools.endurance.vitals import shm_segments
from tools.endurance.worlds import World, canopen_world, ethercat_world, wmx_world

from robotd_testing.domain import own_domain

Kind = tuple[Phase, signal.Signals]
SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGKILL)
FIRST_JOINT_STATE_S = 5.0
SEGMENTS = 6  # in shared memory: robotd removes what is older than 10 s


@dataclass(frozen=True)
class Death:
    """Motion of drives in another process after robotd was killed.

    Attributes:
        limit_s: the watchdog's time and the braking.
        rest_s: from SIGKILL to standstill; None when it could not be seen.
        restart_s: from the start of the next robotd to its first joint state; None likewise.
        problem: empty when all was as it should be.
    """

    backend: str
    limit_s: float
    rest_s: float | None = None
    restart_s: float | None = None
    problem: str = ""


@click.command()
@click.option("--times", default=100, show_default=True, help="Lives on the simulation.")
@click.option("--deaths", default=5, show_default=True, help="Kills in motion per real backend.")
@click.option("--seed", type=int, help="Of the moments. Default: one by the clock, printed.")
@out_option
def main(times: int, deaths: int, seed: int | None, out: Path) -> None:
    """Signals at random moments; exit status 1 when something was not as it should be."""
    seed = time.time_ns() % 10**6 if seed is None else seed
    click.echo(f"seed {seed}")
    chance, where = random.Random(seed), machine()
    lives: list[Life] = []
    died: list[Death] = []
    before = shm_segments()
    try:
        with own_domain() as domain, closing(Client(domain)) as client:
            lives.extend(_lives(Lives(client), times, chance))
            died.extend(_deaths_of(client, deaths, chance))
    finally:  # also of a run that was broken off
        left = shm_segments() - before
        problems = _problems(lives, died, left)
        content = {"seed": seed, "machine": where, "segments_more": left, "problems": problems}
        content["lives"] = [asdict(life) for life in lives]
        content["deaths"] = [asdict(death) for death in died]
        keep(out, "killing", content)
    for line in (*aligned(_table(lives)), "", *aligned(_death_table(died)), "", *problems):
        click.echo(line)
    click.echo(f"segments in /dev/shm: {left:+d}; {len(problems)} problems")
    sys.exit(bool(problems))


def _lives(lives: Lives, times: int, chance: random.Random) -> Iterator[Life]:
    """Every phase with every signal in turn, and a last one that has to start after all of it."""
    kinds = [*product(Phase, SIGNALS)]
    for number, (phase, sent) in enumerate(islice(_endless(kinds, chance), times - 1), 1):
        life = lives.live(phase, sent, chance)
        if life.problem or number % 10 == 0:
            click.echo(f"{number:4d}: {phase}, {sent.name}: {life.problem or 'as it should be'}")
        yield life
    yield lives.live(Phase.IDLE, signal.SIGTERM, chance)


def _endless(kinds: Sequence[Kind], chance: random.Random) -> Iterator[Kind]:
    while True:
        yield from chance.sample(kinds, len(kinds))


def _deaths_of(client: Client, count: int, chance: random.Random) -> Iterator[Death]:
    with tempfile.TemporaryDirectory(prefix="robotd-killing-") as folder:
        worlds: dict[str, AbstractContextManager[World]] = {
            "canopen": canopen_world(Path(folder)),
            "ethercat": ethercat_world(),
            "wmx": wmx_world(),
        }
        for backend, opened in worlds.items() if count else ():
            try:
                with opened as world:
                    yield from deaths(client, world, count, chance)
            except Exception as error:  # noqa: BLE001 - what was seen before is not to be lost
                yield Death(backend, 0.0, problem=f"{type(error).__name__}: {error}")


def deaths(client: Client, world: World, count: int, chance: random.Random) -> Iterator[Death]:
    """Kill robotd while the drives of ``world`` move, ``count`` times."""
    lives = Lives(client, world.arguments, world.robot, world.backend)
    limit_s = world.watchdog_s + world.braking_s
    process, _ = lives.start()
    for _ in range(count):
        with process:
            process.wait_ready()
            lives.swing()
            time.sleep(chance.uniform(0.0, 1.0))
            position = world.look(process.process.pid)
            process.end(signal.SIGKILL)
            rest_s = come_to_rest(position).seconds
        process, restart_s = lives.start()
        slow = f"moved for {rest_s:.2f} s, the limit is {limit_s:g} s" if rest_s > limit_s else ""
        yield Death(world.backend, limit_s, round(rest_s, 3), restart_s, slow)
    with process:
        process.wait_ready()
        assert process.end(signal.SIGTERM) == 0, process.output


def _problems(lives: Sequence[Life], died: Sequence[Death], left: int) -> list[str]:
    found = [f"{life.phase}, {life.number.name}: {life.problem}" for life in lives if life.problem]
    for what, seconds in _starts(lives, died):
        if seconds > FIRST_JOINT_STATE_S:
            found.append(f"{what}: {seconds:.1f} s to the first joint state")
    found += [f"{death.backend}: {death.problem}" for death in died if death.problem]
    if left > SEGMENTS:
        found.append(f"{left} segments more in /dev/shm")
    return found


def _starts(lives: Sequence[Life], died: Sequence[Death]) -> Iterator[tuple[str, float]]:
    for life in lives:
        if life.first_joint_state_s is not None:
            yield str(life.phase), life.first_joint_state_s
    for death in died:
        if death.restart_s is not None:
            yield death.backend, death.restart_s


def _table(lives: Sequence[Life]) -> list[list[str]]:
    rows = [["", *(number.name for number in SIGNALS), "first joint state, s: median", "longest"]]
    for phase in Phase:
        mine = [life for life in lives if life.phase is phase]
        seconds = sorted(life.first_joint_state_s or 0.0 for life in mine)
        cells = []
        for number in SIGNALS:
            ended = [life for life in mine if life.number is number]
            good = sum(not life.problem for life in ended)
            cells.append(f"{good}/{len(ended)}")
        middle, longest = (seconds[len(seconds) // 2], seconds[-1]) if seconds else (0.0, 0.0)
        times = ["–", "–"] if phase is Phase.STARTING else [f"{middle:.2f}", f"{longest:.2f}"]
        rows.append([f"{phase}, as it should be", *cells, *times])
    return rows


def _death_table(died: Sequence[Death]) -> list[list[str]]:
    rows = [["SIGKILL in motion", "s to standstill", "limit", "s to the next joint state"]]
    for death in died:
        seconds = (death.rest_s, death.limit_s, death.restart_s)
        rows.append([death.backend, *("–" if one is None else f"{one:.2f}" for one in seconds)])
    return rows


if __name__ == "__main__":
    main()
