"""Processes that are measured: starting, stopping, and what /proc knows about them."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Self

TIMEOUT_S = 20.0
CPU_CLOCK_SCHED = 2  # linux/posix-timers.h: the clock of everything that a process ran
MIB = 1024.0


class Program:
    """A process with its output in files, ended by SIGTERM at the end of the block.

    Attributes:
        spawned_ns: monotonic time just before it was started.
        pid: of the process.
    """

    def __init__(
        self, command: Sequence[str], environment: Mapping[str, str], *, started: str = ""
    ) -> None:
        self._command = list(command)
        self._environment = dict(environment)
        self._started = started
        self._output = tempfile.TemporaryFile("w+")  # noqa: SIM115 - closed by __exit__
        self._errors = tempfile.TemporaryFile("w+")  # noqa: SIM115 - closed by __exit__

    def __enter__(self) -> Self:
        self.spawned_ns = time.monotonic_ns()
        self._process = subprocess.Popen(
            self._command, env=self._environment, stdout=self._output, stderr=self._errors
        )
        self.pid = self._process.pid
        if self._started:
            try:
                self.wait_output(self._started)
            except BaseException:
                self.__exit__()
                raise
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
        self._output.close()
        self._errors.close()

    @property
    def output(self) -> str:
        """Its standard output so far."""
        return _text(self._output.fileno())

    @property
    def errors(self) -> str:
        """Its standard error so far, which has the log."""
        return _text(self._errors.fileno())

    def wait_output(self, text: str, timeout_s: float = TIMEOUT_S) -> None:
        """Block until its output has ``text``; raises RuntimeError when it ends before."""
        deadline = time.monotonic() + timeout_s
        while text not in self.output:
            if self._process.poll() is not None or time.monotonic() > deadline:
                raise RuntimeError(f"{self._command}: no {text!r}\n{_text(self._errors.fileno())}")
            time.sleep(0.005)

    def stop(self) -> None:
        """End it in order, by force where that takes too long. Twice is not an error."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGTERM)
        try:
            self._process.wait(TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def cpu_s(self) -> float:
        """CPU time of all its threads, ended ones too; user and system."""
        return cpu_s(self.pid)

    def memory_mib(self) -> dict[str, float]:
        """Resident memory, and the same with shared pages divided among those who share."""
        rollup = Path(f"/proc/{self.pid}/smaps_rollup").read_text(encoding="ascii")
        sizes = dict(re.findall(r"^(Rss|Pss):\s+(\d+) kB$", rollup, re.MULTILINE))
        return {f"{key.lower()}_mib": int(size) / MIB for key, size in sizes.items()}


def cpu_s(pid: int) -> float:
    """CPU time of all threads of a process, ended ones too; user and system."""
    return time.clock_gettime((~pid << 3) | CPU_CLOCK_SCHED)


def fresh_environment(domain: int) -> dict[str, str]:
    """Environment of a terminal: a program finds its own ROS libraries, as a user's does."""
    environment = os.environ | {
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # else each start compiles what is new
    if environment.pop("_ROS_WHEELS_BOOTSTRAP_COMPLETE", None):
        environment.pop("LD_LIBRARY_PATH", None)
    return environment


def _text(descriptor: int) -> str:
    return Path(f"/proc/self/fd/{descriptor}").read_text(encoding="utf-8")
