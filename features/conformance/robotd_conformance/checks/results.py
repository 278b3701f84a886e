"""Results of a run in a file, to resume a run that was stopped."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest


class Results:
    """Results of the checks, one JSON object a line; the first line says of what.

    A file of another backend, robot or version, and one of a complete run, is begun anew.

    Args:
        path: file; its folder is made.
        subject: backend, robot and overrides.

    Attributes:
        earlier: names of the checks that passed before this run began.
    """

    def __init__(self, path: Path, subject: Sequence[str]) -> None:
        self._path = path
        head = {"subject": list(subject), "version": version("robotd")}
        lines = self._lines()
        goes_on = bool(lines) and lines[0] == head and lines[-1] != {"complete": True}
        kept = lines[1:] if goes_on else []
        self.earlier = {line["check"] for line in kept if line["outcome"] == "passed"}
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(
            "".join(json.dumps(line) + "\n" for line in [head, *kept]), encoding="utf-8"
        )

    def split(self, items: list[pytest.Item]) -> tuple[list[pytest.Item], list[pytest.Item]]:
        """Return the checks that are left, and those that have passed before."""
        passed = [item for item in items if _name(item.nodeid) in self.earlier]
        return [item for item in items if item not in passed], passed

    def note(self, nodeid: str, outcome: str, duration_s: float) -> None:
        """Add the result of a check."""
        self._add({"check": _name(nodeid), "outcome": outcome, "duration_s": round(duration_s, 2)})

    def complete(self) -> None:
        """Note that no check is left: the next run begins anew."""
        self._add({"complete": True})

    def _add(self, line: dict[str, object]) -> None:
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")

    def _lines(self) -> list[dict[str, Any]]:
        """Return the lines of the file; the last one may have been cut off."""
        lines = list[dict[str, Any]]()
        with suppress(FileNotFoundError, ValueError):
            lines.extend(map(json.loads, self._path.read_text(encoding="utf-8").splitlines()))
        return lines


def _name(nodeid: str) -> str:
    return nodeid.rpartition("/")[2]
