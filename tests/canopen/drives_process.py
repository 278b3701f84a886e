"""Simulated drives in a process of their own, over UDP multicast, and a robot for them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Self

from robotd.descriptor import load_robot_descriptor

GROUP = "239.74.163.9"
PORT = 20000 + os.getpid() % 20000  # one robot for each process of tests


class DrivesProcess:
    """``robotd canopen simulate`` from ``with`` on. One thread."""

    def __init__(self, robot: str = "cr3a") -> None:
        self._robot = robot
        self._process: subprocess.Popen[str] | None = None

    @property
    def running(self) -> bool:
        return self._process is not None

    def start(self) -> None:
        """Power on; returns when all nodes are there."""
        command = [sys.executable, "-m", "robotd", "canopen", "simulate", "--robot", self._robot]
        command += ["--channel", GROUP, "--port", str(PORT)]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
        )
        assert f"{self._robot}: nodes 1, 2" in self._answer()

    def stop(self) -> None:
        """Power off, without a word to anybody. Twice is not an error."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.communicate()

    def tell(self, line: str) -> None:
        """Let a fault happen."""
        assert self._process is not None
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()
        assert self._answer() == "ok\n"

    def _answer(self) -> str:
        assert self._process is not None
        assert self._process.stdout is not None
        return self._process.stdout.readline()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()


def write_robot(folder: Path, robot: str = "cr3a") -> Path:
    """A file of ``robot`` that finds its drives in the process above."""
    base = load_robot_descriptor(robot).path
    path = folder / f"{robot}.yaml"
    path.write_text(
        f"""\
extends: {base}
default_variant: canopen_multicast
variants:
  canopen_multicast:
    backends:
      canopen:
        bus: {{channel: {GROUP}, options: {{port: {PORT}}}}}
""",
        encoding="utf-8",
    )
    return path
