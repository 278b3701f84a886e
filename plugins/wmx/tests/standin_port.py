"""The stand-in's fault port from Python: ``port("slave_lost", 2)``."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager

from standin_build import SDK

PROGRAM = str(SDK / "bin" / "standin-port")


def port(command: str, *arguments: int) -> str:
    """Run a command of ``standin-port``, see there; returns what it prints."""
    words = [PROGRAM, command, *(str(argument) for argument in arguments)]
    return subprocess.run(words, check=True, capture_output=True, text=True).stdout


@contextmanager
def hanging_calls() -> Iterator[subprocess.Popen[str]]:
    """No call of the engine returns; the process that sees to it."""
    pipe = subprocess.PIPE
    with subprocess.Popen([PROGRAM, "hang"], stdin=pipe, stdout=pipe, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "hanging\n"
        yield process
        process.communicate()
