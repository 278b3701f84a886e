"""The stand-in's fault port from Python: ``port("slave_lost", 2)``."""

from __future__ import annotations

import subprocess

from standin_build import SDK


def port(command: str, *arguments: int) -> str:
    """Run a command of ``standin-port``, see there; returns what it prints."""
    program = SDK / "bin" / "standin-port"
    words = [str(program), command, *(str(argument) for argument in arguments)]
    return subprocess.run(words, check=True, capture_output=True, text=True).stdout
