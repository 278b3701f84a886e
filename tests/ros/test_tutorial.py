"""The pages for newcomers do what they say: their console blocks are run, in order.

In a block ``$`` begins a command, ``&`` at its end leaves it running, and ``^C`` is Ctrl-C once
the arm moves. Every other line must appear in the output; ``...`` stands for anything, and a number
with a decimal point for any such number.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from sensor_msgs.msg import JointState
from tests.ros.robot_process import Client, RobotProcess, wait_until

pytestmark = pytest.mark.ros

ROOT = Path(__file__).parents[2]
START = ("make run", "source .venv/bin/activate")  # the test brings both
MOVING_RAD_S = 0.05


class Terminal:
    """A shell beside the robot, in which ``robotd`` is found."""

    def __init__(self, domain: int, joints: list[Any]) -> None:
        self._joints = joints
        self._environment = os.environ | {
            "ROS_DOMAIN_ID": str(domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
        }

    def start(self, command: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            f"exec {command}",
            shell=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=self._environment,
        )

    def run(self, block: str) -> str:
        """The output of all commands of ``block``."""
        begun, outputs = [], []
        for command, is_left, is_interrupted in commands(block):
            process = self.start(command)
            if is_left or is_interrupted:
                self._wait_for_motion(process)
            if is_left:
                begun.append(process)
                continue
            if is_interrupted:
                process.send_signal(signal.SIGINT)
            outputs.append(process.communicate(timeout=90)[0])
        return "".join([*outputs, *(process.communicate(timeout=90)[0] for process in begun)])

    def _wait_for_motion(self, process: subprocess.Popen[str]) -> None:
        def is_moving() -> bool:
            assert process.poll() is None, process.communicate()[0]
            return any(abs(speed) > MOVING_RAD_S for speed in self._joints[-1].velocity)

        wait_until(is_moving, f"no motion by {process.args!r}")


def blocks(page: str) -> list[str]:
    text = (ROOT / page).read_text(encoding="utf-8")
    return re.findall(r"^```console\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def commands(block: str) -> list[tuple[str, bool, bool]]:
    """Command, whether it is left running, whether it is interrupted."""
    found = re.findall(r"^\$ (.*?)( &)?\n(\^C\n)?", block, re.MULTILINE)
    return [(command, bool(left), bool(interrupt)) for command, left, interrupt in found]


def pattern(line: str) -> str:
    parts = re.split(r"([-+]?\d+\.\d+|\.\.\.)", " ".join(line.split()))
    wild = {True: ".*", False: r"[-+]?\d+\.\d+"}
    return "".join(
        wild[part == "..."] if number % 2 else re.escape(part) for number, part in enumerate(parts)
    )


def check(block: str, output: str) -> None:
    plain = " ".join(output.split())
    for line in block.splitlines():
        if not line.startswith(("$ ", "^C")):
            assert re.search(pattern(line), plain), f"{line!r} is not in the output:\n{output}"


@pytest.mark.parametrize("page", ["README.md", "docs/tutorial/first-arm.md"])
def test_the_console_blocks_of_a_page_are_true(page: str) -> None:
    first, *others = [block for block in blocks(page) if commands(block)[0][0] not in START[1:]]
    assert commands(first)[0][0] == START[0]
    with RobotProcess() as robot:
        robot.wait_ready()
        with closing(Client(robot.domain)) as client:
            joints = client.listen(JointState, "/joint_states")
            client.next(joints)
            terminal = Terminal(robot.domain, joints)
            for block in others:
                check(block, terminal.run(block))
        assert robot.end(signal.SIGINT) == 0
        check(first, robot.output)


def test_the_program_of_the_readme_moves_the_arm() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (program,) = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    result = subprocess.run(
        [sys.executable, "-c", program], check=True, capture_output=True, text=True, timeout=90
    )
    assert "goal reached" in result.stdout
