"""The simulated controller as a process: ``franky-sim`` in an environment of its own."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import pytest
from tests.plugins.franka.addresses import free_address

PROGRAM = Path(__file__).with_name("sim_controller.py")
PYTHON = Path(__file__).parents[3] / "plugins/franka/.sim/bin/python"
INSTALL = "franky-sim is not installed: make -C plugins/franka simulator"

needs_simulator = pytest.mark.skipif(not PYTHON.exists(), reason=INSTALL)


@dataclass(frozen=True)
class Truth:
    """State of the simulated arm, by no way through FCI.

    Attributes:
        position, torque: of seven joints, rad and N·m.
        motions, recoveries: numbers of those that clients have begun.
        width: between the fingers of the hand, m.
        hand_commands: names of those that its client has begun: move, grasp, stop.
        hand_force: of the last grasp, N.
        wrench: force and torque that a push on the hand has on the last link, N and N·m.
    """

    position: list[float]
    torque: list[float]
    motions: int
    recoveries: int
    width: float
    hand_commands: list[str]
    hand_force: float
    wrench: list[float]


class Controller:
    """A controller at ``address``, which ends with the block."""

    def __init__(self, address: str) -> None:
        self.address = address

    def __enter__(self) -> Self:
        self.process = subprocess.Popen(
            [PYTHON, PROGRAM, self.address],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "OMP_NUM_THREADS": "1"},
        )
        assert self._answer() == {}
        return self

    def __exit__(self, *error: object) -> None:
        self.kill()

    def kill(self) -> None:
        """End it at once, as a power cut does."""
        self.process.kill()
        self.process.communicate()

    def command(self, **keys: Any) -> Truth:
        """Send a command of ``sim_controller``; return the state after it."""
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps(keys) + "\n")
        self.process.stdin.flush()
        return Truth(**self._answer())

    def _answer(self) -> dict[str, Any]:
        assert self.process.stdout is not None
        return dict(json.loads(self.process.stdout.readline()))


@contextmanager
def controller() -> Iterator[Controller]:
    """A controller at an address of this computer that no other one uses."""
    with Controller(free_address()) as found:
        yield found
