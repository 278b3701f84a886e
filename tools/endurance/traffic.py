"""A client of the soak: ``python -m tools.endurance.traffic KIND ...``, ended by SIGTERM.

Prints what it has counted as a line of JSON, once a second and when it has ended.
"""

from __future__ import annotations

import json
import os
import random
import signal
import threading
from collections import Counter
from collections.abc import Callable
from typing import Any

import click
from tests.ros.robot_process import Client
from tools.bench.process import Program
from tools.endurance.calls import ServiceCalls
from tools.endurance.goals import Goals
from tools.endurance.twists import Twists

from robotd.descriptor import RobotDescriptor, load_robot_descriptor

TAIL_BYTES = 16384  # more than one line; the output of an hour need not be read each second

KINDS: dict[str, Callable[..., Any]] = {"calls": ServiceCalls, "goals": Goals, "twists": Twists}


def kinds_for(descriptor: RobotDescriptor) -> list[str]:
    """The clients that a robot gets: four for services, and one for what it moves by."""
    kinds = ["calls"] * 4
    if "follow_joint_trajectory_server" in descriptor.nodes:
        kinds.append("goals")
    if "diff_drive_controller" in descriptor.nodes:
        kinds.append("twists")
    return kinds


@click.command()
@click.argument("kind", type=click.Choice([*KINDS]))
@click.option("--robot", required=True)
@click.option("--variant")
@click.option("--domain", required=True, type=int)
@click.option("--seed", required=True, type=int)
@click.option("--rate", default=50.0, help="Calls or messages a second.")
def main(kind: str, robot: str, variant: str | None, domain: int, seed: int, rate: float) -> None:
    """Load a running robot with traffic of one kind, at random but for the seed."""
    ended = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: ended.set())
    counts: Counter[str] = Counter()
    client = Client(domain)
    descriptor = load_robot_descriptor(robot, variant)
    traffic = KINDS[kind](client, descriptor, counts, random.Random(seed), rate)
    worker = threading.Thread(target=traffic.run, args=(ended,), daemon=True)
    worker.start()
    while worker.is_alive():
        worker.join(1.0)
        click.echo(json.dumps(dict(counts)))
    client.close()


def newest(program: Program) -> Counter[str]:
    """The last line of a client's output that is complete; empty before the first.

    Raises RuntimeError, with what it says of it, when the client has ended by itself.
    """
    if program._process.poll():
        raise RuntimeError(f"a client ended: {_tail(program._errors.fileno())}")
    *lines, _ = _tail(program._output.fileno()).split("\n")
    counted = [line for line in lines if line.startswith("{")]  # ROS may say something in between
    return Counter(json.loads(counted[-1])) if counted else Counter()


def _tail(descriptor: int) -> str:
    size = os.fstat(descriptor).st_size
    return os.pread(descriptor, TAIL_BYTES, max(0, size - TAIL_BYTES)).decode("utf-8", "replace")


if __name__ == "__main__":
    main()
