"""Texts of comparisons that fail: axis, value and what was expected, instead of whole arrays."""

from __future__ import annotations

from typing import Any

import numpy as np

SHOWN = 6  # axes


def explain(op: str, left: Any, right: Any) -> list[str] | None:
    """Return the lines of a failed ``left == right`` of values per axis; None: pytest explains it.

    ``right`` may be ``pytest.approx`` of an array.
    """
    if op != "==" or not isinstance(left, np.ndarray) or left.ndim != 1:
        return None
    expected = np.asarray(getattr(right, "expected", right), dtype=np.float64)
    if expected.shape != left.shape:
        return None
    granted = _granted(right, expected)
    wrong = np.flatnonzero(~(np.abs(left - expected) <= granted))
    lines = [
        f"axis {axis}: {left[axis]:.6g}, expected {expected[axis]:.6g} ± {granted[axis]:.2g}"
        for axis in wrong[:SHOWN].tolist()
    ]
    return [f"{len(wrong)} of {len(left)} axes differ", *lines] if lines else None


def _granted(approx: Any, expected: np.ndarray) -> np.ndarray:
    """Return the tolerances (n,) of ``pytest.approx``; 0 of anything else."""
    relative, absolute = getattr(approx, "rel", None), getattr(approx, "abs", None)
    if not hasattr(approx, "expected"):
        return np.zeros(len(expected))
    by_default = relative is None and absolute is None
    share = 1e-6 if relative is None and (by_default or absolute is None) else relative or 0.0
    least = 1e-12 if absolute is None else float(absolute)
    return np.asarray(np.maximum(share * np.abs(expected), least))
