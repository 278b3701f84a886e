"""Simulated slaves in a process of their own, also those of a robot: option ``simulated``."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Self

from robotd.api import ConnectError, RobotDescriptor
from robotd_ethercat.bus_namespace import missing_rights, run_in_namespace
from robotd_ethercat.plan import BusPlan
from robotd_ethercat.simulate_command import MASTER, SECOND_MASTER

_STARTED = re.compile(r": \d+ slaves on .+?(?: of (/proc/\d+/ns/net))?;")


class SlavesProcess:
    """``robotd ethercat simulate`` as a child process; ends with its parent.

    Any thread, one at a time. Usable as a context.

    Args:
        arguments: of the command, such as ``["--generic", "3"]`` or ``["--robot", "cr3a"]``.

    Attributes:
        interface, redundant_interface: for the master, on the virtual cable of the process.
        namespace: network namespace of that cable, for ``run_in_namespace``; None while the slaves
            do not run, and where they serve an interface of this computer.
    """

    interface = MASTER
    redundant_interface = SECOND_MASTER

    def __init__(self, arguments: Sequence[str]) -> None:
        self._arguments = list(arguments)
        self._process: subprocess.Popen[str] | None = None
        self.namespace: Path | None = None

    @property
    def running(self) -> bool:
        """True from ``start`` to ``stop``, while the process has not ended by itself."""
        return self._process is not None and self._process.poll() is None

    @property
    def pid(self) -> int:
        """Process id. Raises RuntimeError if it was not started."""
        if self._process is None:
            raise RuntimeError("the simulated slaves are not running; call start()")
        return self._process.pid

    def start(self) -> None:
        """Power on; returns when the slaves are on the bus. Raises RuntimeError."""
        command = [sys.executable, "-m", "robotd_ethercat.simulate_command", "--exit-on-eof"]
        process = subprocess.Popen(  # noqa: S603 - our own command
            [*command, *self._arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            bufsize=1,
            start_new_session=True,  # Ctrl-C is for the parent
        )
        answer = "" if process.stdout is None else process.stdout.readline()
        started = _STARTED.search(answer)
        if started is None:
            process.kill()
            rest, _ = process.communicate()
            raise RuntimeError(f"no simulated slaves: {(answer + rest).strip()}")
        self._process = process
        self.namespace = Path(started.group(1)) if started.group(1) else None

    def stop(self) -> None:
        """Power off: kill the process. Twice is not an error."""
        process, self._process, self.namespace = self._process, None, None
        if process is not None:
            process.kill()
            process.communicate()

    def inject(self, text: str) -> str:
        """Carry out a fault command; return ``ok`` or a value.

        Raises ValueError for a command that is not understood, RuntimeError if the process ended.
        """
        process = self._process
        if process is None or process.stdin is None or process.stdout is None:
            raise RuntimeError("the simulated slaves are not running; call start()")
        try:
            process.stdin.write(text + "\n")
            process.stdin.flush()
            answer = process.stdout.readline().strip()
        except BrokenPipeError:
            answer = ""
        if not answer:
            raise RuntimeError("the process of the simulated slaves has ended")
        if answer.startswith("not understood"):
            raise ValueError(answer)
        return answer

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()


class Simulation:
    """Slaves of the plan, in their own process, on a virtual cable. Worker threads."""

    def __init__(self, robot: RobotDescriptor, plan: BusPlan) -> None:
        self._descriptor = robot.model_dump_json(by_alias=True, exclude_unset=True)
        self._redundant = plan.options.redundant_interface is not None
        self._slaves: SlavesProcess | None = None

    def start(self) -> None:
        """Power on. Raises ConnectError naming what this computer lacks."""
        if self._slaves is not None:
            return
        if (missing := missing_rights()) is not None:
            raise ConnectError("no simulated slaves", {"ethercat": missing}, permanent=True)
        with NamedTemporaryFile("w", suffix=".json") as file:
            file.write(self._descriptor)
            file.flush()
            redundant = ["--redundant"] if self._redundant else []
            slaves = SlavesProcess(["--descriptor", file.name, *redundant])
            try:
                slaves.start()
            except RuntimeError as error:
                raise ConnectError("no simulated slaves", {"ethercat": str(error)}) from error
        self._slaves = slaves

    def stop(self) -> None:
        """Power off. Twice is not an error."""
        slaves, self._slaves = self._slaves, None
        if slaves is not None:
            slaves.stop()

    @property
    def pid(self) -> int:
        """Process id of the slaves. Raises ConnectError while powered off."""
        return self._running().pid

    def run(self, action: Callable[[], None]) -> None:
        """Run ``action`` where the interfaces are. Raises ConnectError while powered off."""
        run_in_namespace(self._running().namespace, action)

    def inject(self, line: str) -> str:
        """Carry out a fault command. Raises ConnectError while powered off, ValueError."""
        return self._running().inject(line)

    def _running(self) -> SlavesProcess:
        if self._slaves is None:
            raise ConnectError("the simulated slaves are not running")
        return self._slaves
