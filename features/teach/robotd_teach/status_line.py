"""Status of a command that waits, on standard error."""

from __future__ import annotations

import shutil
import sys
from contextlib import suppress

import click

from robotd.api.commands import escaped
from robotd_ros.commands.goal import CLEAR_LINE


class StatusLine:
    """Lines that stay, and one below them that is replaced, on a terminal only.

    Nothing is raised where the terminal is lost: the robot still has to be stopped.
    """

    def __init__(self) -> None:
        self._is_terminal = sys.stderr.isatty()

    def keep(self, text: str) -> None:
        """Print a line that stays."""
        self._print(escaped(text) + "\n")

    def replace(self, text: str) -> None:
        """Show a line in place of the last one."""
        if self._is_terminal:
            self._print(escaped(text)[: shutil.get_terminal_size().columns - 1])

    def end(self) -> None:
        """Clear the line."""
        self._print("")

    def _print(self, text: str) -> None:
        with suppress(OSError):
            click.echo((CLEAR_LINE if self._is_terminal else "") + text, nl=False, err=True)
