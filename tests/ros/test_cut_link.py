"""A network link that is cut and heals: what was commanded meanwhile moves nothing afterwards."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import pytest
from tests.ros.robot_process import RobotProcess, wait_until
from tests.ros.split_network import ENVIRONMENT, SplitNetwork, obstacle, split_network

from robotd_testing.domain import own_domain

REASON = obstacle()
pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(bool(REASON), reason=f"no network namespaces: {REASON}"),
]

STILL = 1e-3  # rad and rad/s
# After the first message of the healed link; a heartbeat of Fast DDS comes every 3 s.
SETTLED_S = 4.0


class Process:
    """``tests.ros.remote_commander`` on one side of the link; its lines are kept."""

    def __init__(self, side: Sequence[str], domain: int, *arguments: str) -> None:
        self.lines: list[str] = []
        self._process = subprocess.Popen(
            [*side, sys.executable, "-m", "tests.ros.remote_commander", *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | ENVIRONMENT | {"ROS_DOMAIN_ID": str(domain)},
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def send(self, line: str) -> None:
        assert self._process.stdin
        self._process.stdin.write(f"{line}\n")
        self._process.stdin.flush()

    def end(self) -> None:
        self._process.kill()
        with self._process:  # waits, and closes the pipes
            self._reader.join()

    def _read(self) -> None:
        assert self._process.stdout
        for line in self._process.stdout:
            self.lines.append(line.strip())


class Axis:
    """First axis of the robot, as a program beside it sees it."""

    def __init__(self, watcher: Process) -> None:
        self.watcher = watcher

    @property
    def states(self) -> list[list[float]]:
        lines = self.watcher.lines
        return [[*map(float, line.split())] for line in lines if " " in line]

    @property
    def position(self) -> float:
        return self.states[-1][0]

    def wait_moved(self, start: float) -> None:
        wait_until(lambda: self.states and self.position > start + 0.05, "motion")

    def wait_at_rest(self) -> None:
        def at_rest() -> bool:
            return all(abs(velocity) < STILL for _, velocity in self.states[-20:])

        wait_until(at_rest, "standstill")


@contextmanager
def robot_beyond_link(network: SplitNetwork, robot: str) -> Iterator[tuple[RobotProcess, Axis]]:
    with (
        own_domain() as domain,
        RobotProcess(
            domain=domain, robot=robot, prefix=network.robot, environment=ENVIRONMENT
        ) as process,
    ):
        process.wait_ready()
        watcher = Process(network.robot, domain, "watch")
        try:
            yield process, Axis(watcher)
        finally:
            watcher.end()


@pytest.fixture(scope="module")
def network() -> Iterator[SplitNetwork]:
    with split_network() as network:
        yield network


@pytest.fixture(scope="module")
def arm(network: SplitNetwork) -> Iterator[tuple[RobotProcess, Axis]]:
    with robot_beyond_link(network, "cr3a") as arm:
        yield arm


@pytest.fixture(scope="module")
def base(network: SplitNetwork) -> Iterator[tuple[RobotProcess, Axis]]:
    with robot_beyond_link(network, "baymax") as base:
        yield base


def cut_while_commanded(
    network: SplitNetwork,
    robot: tuple[RobotProcess, Axis],
    kind: str,
    cut: str,
    seconds: float,
) -> tuple[float, float]:
    """Cut the link of a moving robot; return its position before and after the link has healed.

    The client commands on for a while and falls silent before the link heals.
    """
    process, axis = robot
    client = Process(network.client, process.domain, "publish", kind)
    try:
        wait_until(lambda: axis.states and client.lines, "the client")
        start = axis.position
        client.send("go")
        axis.wait_moved(start)
        network.cut(cut)
        cut_s = time.monotonic()
        axis.wait_at_rest()
        time.sleep(max(0.0, cut_s + seconds - 1.0 - time.monotonic()))  # the commands of the cut
        client.send("halt")
        time.sleep(1.0)  # silence of more than every time-out
        before, probes = axis.position, axis.watcher.lines.count("probe")
        network.heal(cut)

        def probed() -> bool:
            client.send("probe")
            time.sleep(0.1)
            return axis.watcher.lines.count("probe") > probes

        wait_until(probed, "a message over the healed link")
        seen = len(axis.states)
        wait_until(lambda: len(axis.states) > seen + 100 * SETTLED_S, "states")
        states = axis.states[seen - 100 :]
        return before, max((position for position, _ in states), key=lambda p: abs(p - before))
    finally:
        client.end()


@pytest.mark.parametrize(
    ("kind", "cut", "seconds"),
    [
        ("position", "switch", 3.0),
        ("position", "switch", 15.0),
        ("position", "interface", 3.0),
        ("points", "switch", 3.0),
        ("points", "switch", 15.0),
        ("points", "interface", 3.0),
        ("stamped_jog", "switch", 3.0),
        ("jog", "switch", 3.0),
        ("jog", "switch", 15.0),
        ("moves", "switch", 3.0),
    ],
)
def test_an_arm_executes_nothing_that_was_sent_during_a_cut(
    network: SplitNetwork,
    arm: tuple[RobotProcess, Axis],
    kind: str,
    cut: str,
    seconds: float,
) -> None:
    before, after = cut_while_commanded(network, arm, kind, cut, seconds)
    assert after == pytest.approx(before, abs=STILL)


def test_what_a_reliable_publisher_sends_again_is_named_and_counted(
    network: SplitNetwork, arm: tuple[RobotProcess, Axis]
) -> None:
    process, _ = arm
    # A busy computer delivers single messages late as well, by tenths of a second.
    late = re.compile(r"(\d+\.?\d*) s older than this computer's clock: (.*)")
    told = len(late.findall(process.output))
    cut_while_commanded(network, arm, "points", "switch", 3.0)
    causes = [cause for age, cause in late.findall(process.output)[told:] if float(age) > 1.0]
    assert len(causes) == 1, "one line for the commands of one cut"
    assert "are the clocks of both computers in step (chrony, ptp)?" in causes[0]


@pytest.mark.parametrize(("cut", "seconds"), [("switch", 3.0), ("switch", 15.0)])
def test_a_base_executes_nothing_that_was_sent_during_a_cut(
    network: SplitNetwork, base: tuple[RobotProcess, Axis], cut: str, seconds: float
) -> None:
    before, after = cut_while_commanded(network, base, "twist", cut, seconds)
    assert after == pytest.approx(before, abs=STILL)
