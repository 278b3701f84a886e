"""A bad computer and its effect on a robot: ``python -m tools.endurance.machine``."""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import click
from sensor_msgs.msg import JointState
from tests.ros.robot_process import Client
from tools.bench.machine import machine
from tools.bench.process import Program, fresh_environment
from tools.bench.results import keep, out_option
from tools.bench.tables import aligned
from tools.endurance.cases import in_turn
from tools.endurance.conditions import CONDITIONS
from tools.endurance.honest import FASTEST_RAD_S, afterwards, lateness_us, swing
from tools.endurance.monitor import Monitor

from robotd_testing.domain import own_domain

SECONDS = 6.0
LEVELS = ("OK", "WARN", "ERROR", "STALE")


@dataclass(frozen=True)
class Borne:
    """Behaviour of a robot under one condition.

    Attributes:
        lateness_p50_us, lateness_p99_us, lateness_max_us: of the cycle meanwhile.
        missed: deadlines, meanwhile.
        cycle: the worst that /diagnostics said of the cycle meanwhile.
        fastest_rad_s: of the joints meanwhile.
        goals: that ended well, and all of them.
        problem: empty when all was as it should be.
    """

    condition: str
    lateness_p50_us: float
    lateness_p99_us: float
    lateness_max_us: float
    missed: int
    control_loop: str
    fastest_rad_s: float
    goals: tuple[int, int]
    problem: str


@click.command()
@click.argument("conditions", nargs=-1, type=click.Choice([*CONDITIONS]))
@click.option("--seconds", default=SECONDS, show_default=True, help="Of each condition.")
@out_option
def main(conditions: Sequence[str], seconds: float, out: Path) -> None:
    """Run a robot under CONDITIONS, by default all; exit status 1 when it is not safe."""
    facts = machine()
    cases = {name: CONDITIONS[name].summary for name in conditions or CONDITIONS}
    borne = in_turn(cases, lambda name: bear(name, seconds))
    for line in aligned(_table(borne)):
        click.echo(line)
    content = {"machine": facts, "seconds": seconds, "borne": [asdict(client) for client in borne]}
    keep(out, "machine", content)
    sys.exit(any(client.problem for client in borne))


def bear(name: str, seconds: float) -> Borne:
    """A robot that moves under a condition."""
    condition = CONDITIONS[name]
    with (
        tempfile.TemporaryDirectory(prefix="robotd-machine-") as folder,
        own_domain() as domain,
        ExitStack() as stack,
    ):
        report = Path(folder, "report.json")
        environment = fresh_environment(domain) | condition.environment(Path(folder))
        command = ["sh", "-c", f'exec "$0" "$@" {condition.redirect}', sys.executable]
        command += ["-m", "robotd", "--robot", "cr3a", "--backend", "sim", "--report", str(report)]
        robot = stack.enter_context(Program(command, environment))
        client = Client(domain)
        stack.callback(client.close)
        client.wait_engine()
        speeds = _speeds(client)
        problem = afterwards(client)
        monitor = Monitor(client)
        speeds.clear()
        window, ends = _move(condition.during(Path(folder)), seconds, client)
        fastest, control_loop = max(speeds, default=0.0), LEVELS[monitor.worst.get("cycle", 3)]
        missed = _missed(monitor)
        problem = problem or _unsafe(ends, fastest) or afterwards(client)
        robot.stop()
        if status := robot._process.returncode:
            problem = problem or f"exit status {status}"
        late = lateness_us(report, *window)
    goals = ends.count(""), len(ends)
    return Borne(name, *late, missed, control_loop, round(fastest, 3), goals, problem)


def _speeds(client: Client) -> list[float]:
    """The largest speed of a joint, of every message that comes from now on."""
    speeds: list[float] = []

    def on_message(message: Any) -> None:
        speeds.append(max(map(abs, message.velocity[:6])))

    client.node.create_subscription(JointState, "/joint_states", on_message, 10)
    return speeds


def _move(
    during: AbstractContextManager[Any], seconds: float, client: Client
) -> tuple[tuple[int, int], list[str]]:
    """Begin and end in monotonic ns, and why each goal failed, empty where it did not."""
    ends: list[str] = []
    began_ns = time.monotonic_ns()
    with during:
        while time.monotonic_ns() - began_ns < seconds * 1e9:
            ends.append(swing(client, len(ends)))
        ended_ns = time.monotonic_ns()
    return (began_ns, ended_ns), ends


def _missed(monitor: Monitor) -> int:
    first, newest = monitor.first, monitor.newest
    return newest.missed - first.missed if first and newest else 0


def _unsafe(ends: Sequence[str], fastest_rad_s: float) -> str:
    if fastest_rad_s > FASTEST_RAD_S:
        return f"a joint moved with {fastest_rad_s:.2f} rad/s, the limit is {FASTEST_RAD_S} rad/s"
    return next(filter(None, ends), "")


def _table(borne: Sequence[Borne]) -> list[list[str]]:
    rows = [["", "late p50 µs", "p99", "max", "missed", "/diagnostics", "rad/s", "goals", ""]]
    for client in borne:
        times = (client.lateness_p50_us, client.lateness_p99_us, client.lateness_max_us)
        good, sent = client.goals
        cells = [*(f"{value:.0f}" for value in times), str(client.missed), client.control_loop]
        cells += [f"{client.fastest_rad_s:.2f}", f"{good}/{sent}"]
        cells.append("BROKEN" if client.problem else "safe")
        rows.append([client.condition, *cells])
    return rows


if __name__ == "__main__":
    main()
