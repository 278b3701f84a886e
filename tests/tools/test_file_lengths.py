"""Modules stay short enough to be read alone."""

from __future__ import annotations

import pytest
from tools.file_lengths import LONGER, MAX_LINES, too_long

LISTED, LIMIT = next(iter(LONGER.items()))


@pytest.mark.parametrize(
    ("path", "lines", "reason"),
    [
        ("core/robotd/robot.py", MAX_LINES + 1, "more than 500"),
        (LISTED, LIMIT + 1, f"more than {LIMIT}"),
        (LISTED, MAX_LINES, "needs no row"),
    ],
)
def test_a_module_that_is_too_long_is_named(path: str, lines: int, reason: str) -> None:
    (found,) = too_long({path: lines})
    assert found.startswith(f"{path} has {lines} lines")
    assert reason in found


def test_what_is_as_long_as_it_may_be_is_accepted() -> None:
    assert [*too_long({"core/robotd/robot.py": MAX_LINES, LISTED: LIMIT})] == []
