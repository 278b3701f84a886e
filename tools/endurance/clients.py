"""Misbehaving clients and their effect on a robot: ``python -m tools.endurance.clients``."""

from __future__ import annotations

import os
import signal
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import click
from tests.ros.robot_process import Client, RobotProcess
from tools.bench.machine import machine
from tools.bench.process import Program, fresh_environment
from tools.bench.results import keep, out_option
from tools.bench.tables import aligned
from tools.endurance.cases import in_turn
from tools.endurance.honest import afterwards, lateness_us, swing
from tools.endurance.rude import KINDS
from tools.endurance.vitals import vitals

SECONDS = 8.0  # with what follows, no longer than the robot keeps its samples: 16 s
LATENESS_P99_US = 1000.0
MEMORY_MIB = 30.0  # 1000 goals and their results are kept for 10 s


@dataclass(frozen=True)
class Seen:
    """Observations of a robot while clients of one kind misbehaved, and afterwards.

    Attributes:
        lateness_p50_us, lateness_p99_us, lateness_max_us: of the cycle meanwhile.
        memory_mib: more than before.
        goals: of an honest client meanwhile, that ended well, and all of them.
        failures: why the others did not end well.
        problem: empty when all was as it should be; lateness is not part of it.
    """

    kind: str
    lateness_p50_us: float
    lateness_p99_us: float
    lateness_max_us: float
    memory_mib: float
    goals: tuple[int, int]
    failures: tuple[str, ...]
    problem: str


@click.command()
@click.argument("kinds", nargs=-1, type=click.Choice([*KINDS]))
@click.option("--seconds", default=SECONDS, show_default=True, help="Of each misbehaviour.")
@out_option
def main(kinds: Sequence[str], seconds: float, out: Path) -> None:
    """Let clients of KINDS misbehave, by default of all; exit status 1 when a robot suffers."""
    facts = machine()
    cases = {kind: str(KINDS[kind].__doc__) for kind in kinds or KINDS}
    seen = in_turn(cases, lambda kind: endure(kind, seconds))
    for line in aligned(_table(seen)):
        click.echo(line)
    late = [client for client in seen if client.lateness_p99_us > LATENESS_P99_US]
    content = {"machine": facts, "seconds": seconds, "seen": [asdict(client) for client in seen]}
    keep(out, "clients", content)
    sys.exit(bool(late or any(client.problem for client in seen)))


def endure(kind: str, seconds: float, *options: str) -> Seen:
    """A robot of its own, a client of ``kind`` with ``options`` of ``rude``, and an honest one."""
    with tempfile.TemporaryDirectory(prefix="robotd-clients-") as folder:
        report = Path(folder, "report.json")
        with RobotProcess("--report", str(report)) as robot:
            robot.wait_ready()
            client = Client(robot.domain)
            try:
                client.wait_engine()
                problem = swing(client, 0)  # whatever is made once is made now
                before = vitals(robot.process.pid).rss_mib
                window, reasons = _misbehave((kind, *options), seconds, robot, client)
                problem = problem or _afterwards(client)
                more = vitals(robot.process.pid).rss_mib - before
            finally:
                client.close()
            status = robot.end(signal.SIGTERM)
            if "Traceback" in robot.output:
                problem = problem or f"traceback in the log:\n{robot.output[-3000:]}"
        lateness = lateness_us(report, *window)
    if status:
        problem = problem or f"exit status {status}"
    if more > MEMORY_MIB:
        problem = problem or f"{more:.0f} MiB more memory, the limit is {MEMORY_MIB:g} MiB"
    failures = tuple(filter(None, reasons))
    goals = len(reasons) - len(failures), len(reasons)
    return Seen(kind, *lateness, round(more, 2), goals, failures, problem)


def _afterwards(client: Client) -> str:
    try:
        return afterwards(client)
    except AssertionError as error:
        return f"afterwards: {error}"


def _misbehave(
    rude_arguments: Sequence[str], seconds: float, robot: RobotProcess, client: Client
) -> tuple[tuple[int, int], list[str]]:
    """Begin and end in monotonic ns, and why each goal of the honest client failed, if it did."""
    kind, *options = rude_arguments
    command = [sys.executable, "-m", "tools.endurance.rude", kind, str(robot.domain), *options]
    reasons: list[str] = []
    with Program(command, fresh_environment(robot.domain), started="misbehaving") as rude:
        began_ns = time.monotonic_ns()
        if kind == "deaf":
            os.kill(rude.pid, signal.SIGSTOP)
        if kind == "vanish":
            time.sleep(1.0)
            os.kill(rude.pid, signal.SIGKILL)
        while time.monotonic_ns() - began_ns < seconds * 1e9:
            if kind == "crowd":
                time.sleep(0.1)  # a thousand goals preempt every other
                continue
            reasons.append(swing(client, len(reasons) + 1))
        ended_ns = time.monotonic_ns()
        assert kind == "vanish" or rude._process.poll() is None, "the client misbehaved no longer"
        os.kill(rude.pid, signal.SIGKILL)
    return (began_ns, ended_ns), reasons


def _table(seen: Sequence[Seen]) -> list[list[str]]:
    rows = [["", "late p50 µs", "p99", "max", "memory MiB", "goals", "afterwards"]]
    for client in seen:
        times = (client.lateness_p50_us, client.lateness_p99_us, client.lateness_max_us)
        cells = [*(f"{value:.0f}" for value in times), f"{client.memory_mib:+.1f}"]
        good, sent = client.goals
        rows.append([client.kind, *cells, f"{good}/{sent}", "BROKEN" if client.problem else "well"])
    return rows


if __name__ == "__main__":
    main()
