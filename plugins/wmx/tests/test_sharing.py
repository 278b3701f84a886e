"""Several programs on one engine: they see each other's motion, and leave each other alone."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest
from robotd_testing.domain import own_domain

from robotd.clock import MonotonicClock, wait_until
from robotd.control.loop.setpoint_source import Outcome
from robotd.device.axes import Move
from robotd.motion.profile import Profile
from robots import descriptor, eventually, goal, running
from standin_build import PLUGIN, SDK, build_program, run
from standin_port import port

PROFILE = Profile(1.0, 10.0, 10.0)
TIMEOUT_S = 30.0


class Daemon:
    """A ``robotd`` that serves cr3a on the engine, in a ROS domain of its own."""

    def __init__(self, robot: Path, domain: int, *arguments: str) -> None:
        self._environment = os.environ | {
            "ROS_DOMAIN_ID": str(domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        }
        words = ["--robot", str(robot), "--backend", "wmx", *arguments]
        self.process = self._start(*words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)

    def _start(self, *words: str, **pipes: int) -> subprocess.Popen[str]:
        command = [sys.executable, "-P", "-m", "robotd", *words]
        return subprocess.Popen(command, env=self._environment, text=True, **pipes)  # type: ignore[call-overload,no-any-return]

    def call(self, *words: str) -> str:
        """The output of a command of robotd to this daemon."""
        with self._start(*words, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as client:
            output, errors = client.communicate(timeout=60)
        assert client.returncode == 0, errors
        return str(output)

    def position(self, axis: int) -> float:
        report = json.loads(self.call("status", "--json", "--timeout", "20"))
        return float(report["axes"][axis]["position"])

    def sees(self, axis: int, position: float, other: Daemon) -> None:
        """Wait until it reports the axis at ``position``; else fail with what all report."""

        def arrived() -> bool:
            return self.position(axis) == pytest.approx(position, abs=1e-4)

        assert wait_until(arrived, TIMEOUT_S, MonotonicClock()), (
            f"axis {axis} is not at {position:g}: {self.position(axis)} here,"
            f" {other.position(axis)} at the other daemon, on the engine:\n{port('show')}"
        )

    def wait_ready(self) -> None:
        assert self.process.stdout
        lines = []
        for line in self.process.stdout:
            if "ready after" in line:
                return
            lines.append(line)
        pytest.fail(f"the daemon ended:\n{''.join(lines)}")


@contextmanager
def daemon(robot: Path, *arguments: str) -> Iterator[Daemon]:
    with ExitStack() as exits:
        served = Daemon(robot, exits.enter_context(own_domain()), *arguments)
        try:
            served.wait_ready()
            yield served
        finally:
            served.process.terminate()
            served.process.communicate(timeout=90)


@pytest.mark.timeout(180)
def test_two_daemons_and_a_program_see_each_others_motion(tmp_path: Path) -> None:
    program = build_program(PLUGIN / "tests" / "programs" / "mover.cpp")
    guest_file = descriptor(tmp_path, shared=True, spline_channel=1)
    with (
        daemon(descriptor(tmp_path)) as owner,
        daemon(guest_file) as guest,
    ):
        owner.call("move", "joint1=0.2", "--time", "0.5", "--timeout", "20")
        guest.sees(0, 0.2, owner)
        guest.call("move", "joint1=0.1", "--time", "0.5", "--timeout", "20")
        owner.sees(0, 0.1, guest)
        assert float(run(program, f"{SDK}/", "4", "0.25")) == pytest.approx(0.25)
        owner.sees(4, 0.25, guest)
        guest.sees(4, 0.25, owner)


def test_a_program_on_the_same_engine_moves_our_axis_and_we_see_it(tmp_path: Path) -> None:
    program = build_program(PLUGIN / "tests" / "programs" / "mover.cpp")
    with running(tmp_path) as robot:
        where = float(run(program, f"{SDK}/", "4", "0.25"))
        assert where == pytest.approx(0.25)
        eventually(lambda: abs(robot.image.position[4] - 0.25) < 1e-5)
        assert robot.io.output_bit(3, 2)
        assert robot.connection.ready


def test_two_robots_share_an_engine(tmp_path: Path) -> None:
    with running(tmp_path) as owner:
        with running(tmp_path, enable=False, shared=True, spline_channel=1) as guest:
            owner.axes.move([Move(0, 0.2, PROFILE)])
            eventually(lambda: abs(guest.image.position[0] - 0.2) < 1e-5)
            with guest.follower.follow(goal([0.5], 0.3)) as execution:
                assert execution.wait(30.0)
            assert execution.outcome is Outcome.SUCCEEDED, execution.message
            np.testing.assert_allclose(owner.image.position, 0.3, atol=1e-5)
        # The guest has switched the axes off at its end, and left the engine alone.
        assert owner.connection.ready
        owner.servos.enable()
        owner.axes.move([Move(0, 0.1, PROFILE)])
