"""Faults that each check is known to find, and the checks of a quick run.

Both are measured: the faults are those of the mutants that the gate runs, the quick checks find
most of them in their time. ``python -m tests.features.conformance.runs.measured_faults`` writes
the file.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

PATH = Path(__file__).with_suffix(".json")
SHOWN = 4  # faults in a report


@cache
def _content() -> dict[str, Any]:
    return dict(json.loads(PATH.read_text(encoding="utf-8")))


def quick_checks() -> frozenset[str]:
    """Return the names (``test_units.py::test_…``) of the checks of a quick run."""
    return frozenset(_content()["quick"])


def likely_faults(check: str) -> list[str]:
    """Return some faults that ``check`` has found in mutants; its parameters are ignored."""
    return list(_content()["found"].get(check.partition("[")[0], ()))[:SHOWN]
