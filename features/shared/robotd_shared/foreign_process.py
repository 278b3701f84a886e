"""Examination of foreign plugins in a process of its own, so that a crash is attributed.

A plugin can call ``os._exit``, crash in native code or hang with the interpreter held; nothing
inside the process can report that. The child notes each step in a file before it begins.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Self

from robotd.api import PluginError
from robotd.api.commands import Interrupt, stop_signals
from robotd.api.robots import PluginOrigin, find_backend, load_backend

STEPS = "ROBOTD_STEP_FILE"
STEP_LIMIT_S = 150.0  # longest time between two notes; each step has shorter limits of its own
POLL_S = 0.05
OWN_DISTRIBUTION = "robotd"  # its plugins are run in this process


@dataclass(frozen=True)
class BackendSummary:
    """Description of a backend."""

    summary: str
    capabilities: list[str]
    api_version: int

    @classmethod
    def of(cls, name: str) -> Self:
        """Load the backend ``name``. Raises PluginError."""
        backend = load_backend(name)
        return cls(backend.info.summary, sorted(backend.capabilities), backend.info.api_version)


def is_foreign(origin: PluginOrigin) -> bool:
    """Return whether ``origin`` is another distribution than robotd's own."""
    return origin.distribution != OWN_DISTRIBUTION


def note_step(step: str) -> None:
    """Name what begins now, for the parent; without one no effect. Any thread."""
    if path := os.environ.get(STEPS):
        Path(path).write_text(step, encoding="utf-8")


def run_noted(
    command: Sequence[str],
    environment: dict[str, str] | None = None,
    *,
    capture: bool,
    grace_s: float = 0.0,
) -> tuple[int, str, str]:
    """Run ``command``; return its exit status, its output where captured, and its last step.

    The status is negative after a signal. A child that notes no step for ``STEP_LIMIT_S`` is
    killed. "done" is the last step of a child that ran to its end. Main thread only.

    A stop signal is passed on to the child as SIGINT, and raises KeyboardInterrupt when that has
    ended. It is killed after ``grace_s``, or at a further Ctrl-C.
    """
    with tempfile.TemporaryDirectory(prefix="robotd-") as folder:
        steps, output = Path(folder) / "step", Path(folder) / "output"
        steps.write_text("starting Python", encoding="utf-8")
        variables = {
            **(environment or os.environ),
            "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),  # it finds what we find
            STEPS: str(steps),
        }
        with output.open("w") as into:
            child = subprocess.Popen(  # noqa: S603 - our own command line
                command,
                env=variables,
                stdout=into if capture else None,
                stderr=subprocess.STDOUT if capture else None,
            )
            try:
                status = _wait(child, steps, grace_s)
            finally:
                if child.poll() is None:
                    child.kill()
                    child.wait()
        return status, output.read_text(errors="replace"), steps.read_text(encoding="utf-8")


def death_of(name: str, status: int, step: str) -> PluginError:
    """Return the error for a plugin ``name`` whose process ended by itself during ``step``."""
    origin, _ = find_backend(name)
    return PluginError(f"plugin {origin} ended the process with {end_of(status)} while {step}")


def end_of(status: int) -> str:
    """Return ``status 9``, or ``signal SIGSEGV`` for a negative exit status."""
    return f"signal {signal.Signals(-status).name}" if status < 0 else f"status {status}"


def probe_backend(name: str) -> BackendSummary:
    """Load the backend ``name`` in a process of its own and return its description.

    Raises PluginError: as ``load_backend``, or the plugin ended the process.
    """
    status, output, step = run_noted([sys.executable, "-m", __name__, name], capture=True)
    if step != "done":
        raise death_of(name, status, step)
    *said, last = output.splitlines()
    sys.stderr.write("".join(f"{line}\n" for line in said if line))
    answer = json.loads(last)
    if "problem" in answer:
        raise PluginError(answer["problem"])
    return BackendSummary(**answer)


def _wait(child: subprocess.Popen[bytes], steps: Path, grace_s: float) -> int:
    noted_ns, noted_s = 0, 0.0
    with Interrupt() as interrupt:
        while not interrupt.happened:
            with suppress(subprocess.TimeoutExpired):
                return child.wait(POLL_S)
            now_s = time.monotonic()  # the clock that stamps files may be set meanwhile
            if (file_ns := steps.stat().st_mtime_ns) != noted_ns:
                noted_ns, noted_s = file_ns, now_s
            if now_s - noted_s > STEP_LIMIT_S:
                child.kill()
        for number in stop_signals():
            signal.signal(number, signal.SIG_IGN)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        child.send_signal(signal.SIGINT)
        with suppress(subprocess.TimeoutExpired):
            child.wait(grace_s)
    raise KeyboardInterrupt


def _describe(name: str) -> dict[str, object]:
    try:
        return asdict(BackendSummary.of(name))
    except PluginError as error:
        return {"problem": str(error)}


if __name__ == "__main__":
    note_step("being imported and described")
    sys.stdout.write(f"\n{json.dumps(_describe(sys.argv[1]))}\n")
    sys.stdout.flush()
    note_step("done")
    os._exit(0)  # threads of the plugin may go on for ever
