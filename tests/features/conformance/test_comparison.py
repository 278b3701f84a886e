"""Texts of comparisons that fail: the axis, its value, and what was expected."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from robotd_conformance.checks.comparison import explain

VALUES = np.array([0.1, 0.3123, np.nan])


@pytest.mark.parametrize(
    ("expected", "lines"),
    [
        (
            pytest.approx(np.array([0.1, 0.3, 0.0]), abs=0.002),
            ["axis 1: 0.3123, expected 0.3 ± 0.002", "axis 2: nan, expected 0 ± 0.002"],
        ),
        (
            pytest.approx(np.array([0.2, 0.3123, 0.0]), rel=0.1, abs=0.01),
            ["axis 0: 0.1, expected 0.2 ± 0.02", "axis 2: nan, expected 0 ± 0.01"],
        ),
        (
            np.array([0.1, 0.3123, 1.0]),
            ["axis 2: nan, expected 1 ± 0"],
        ),
    ],
)
def test_axes_that_differ_are_named(expected: Any, lines: list[str]) -> None:
    found = explain("==", VALUES, expected)
    assert found == [f"{len(lines)} of 3 axes differ", *lines]


def test_anything_else_is_left_to_pytest() -> None:
    assert explain("==", 3, 4) is None
    assert explain("<", VALUES, VALUES) is None
    assert explain("==", VALUES, np.zeros(2)) is None
