"""Report of checks: one line each, and the exit status."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import click

from robotd.cli.exit_codes import ExitCode, exit_code
from robotd.errors import RobotdError

Found = TypeVar("Found")


@dataclass
class CheckReport:
    """Prints a line for each check; ``code`` belongs to the first failure."""

    code: ExitCode = ExitCode.OK
    problems: int = 0

    def run(self, what: str, check: Callable[[], Found]) -> Found | None:
        """Return the result of ``check``; None when it raised. Print a text result."""
        try:
            found = check()
        except RobotdError as error:
            self.fail(what, error)
            return None
        self._line("ok", "green", f"{what}: {found}" if isinstance(found, str) else what)
        return found

    def fail(self, what: str, error: RobotdError) -> None:
        self.code = self.code or exit_code(error)
        lines = str(error).splitlines()
        self.problems += len(lines)
        self._line("fail", "red", what)
        for line in lines:
            click.echo(f"      {line}")

    def warn(self, text: str) -> None:
        """Print what is accepted and still unwise; the exit status stays."""
        self._line("warn", "yellow", text)

    def end(self) -> ExitCode:
        """Print the last line and return the exit status."""
        count = f"{self.problems} problem{'' if self.problems == 1 else 's'}"
        click.echo(count if self.problems else "all checks passed")
        return self.code

    def _line(self, word: str, colour: str, text: str) -> None:
        click.echo(f"{click.style(word.ljust(4), fg=colour)}  {text}")
