"""Percentiles of measured times."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def percentiles(name: str, values_us: NDArray[Any]) -> dict[str, float]:
    """``name_p50_us``, ``name_p99_us`` and ``name_max_us``; NaN where there are no values."""
    tops = np.percentile(values_us, (50, 99, 100)) if len(values_us) else np.full(3, np.nan)
    return {
        f"{name}_{part}_us": float(value)
        for part, value in zip(("p50", "p99", "max"), tops, strict=True)
    }
