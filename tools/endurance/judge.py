"""The bounds of the soak, and how growth differs from noise."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import theilslopes
from tools.endurance.monitor import CycleLook

WARM_UP_S = 1200.0  # of a long run; a short one warms up for a third of its time
RSS_MIB = 2.0  # by the fit, over all of the run: an allocator's own movements are below it
COUNT = 0.5  # of threads, descriptors, mappings: one more for good is too many
DRIFT = 1e-3
FIT_SAMPLES = 600


@dataclass(frozen=True)
class Bound:
    """A figure and the most that it may be."""

    what: str
    measured: float
    limit: float
    unit: str = ""

    @property
    def kept(self) -> bool:
        return self.measured <= self.limit


def growth(times_s: Sequence[float], values: Sequence[float]) -> float:
    """Return the growth of a value after the warm-up: median slope times duration.

    Theil and Sen's slope: up to 29 % of the samples may be outliers.
    """
    time, value = np.asarray(times_s), np.asarray(values, dtype=float)
    later = time >= time[0] + min(WARM_UP_S, (time[-1] - time[0]) / 3.0)
    time, value = _thinned(time[later]), _thinned(value[later])
    slope = theilslopes(value, time).slope if len(time) > 1 else 0.0
    return float(slope * (time[-1] - time[0]))


def drift(first: CycleLook, last: CycleLook, rate_hz: float) -> float:
    """Return the relative difference between periods, run or missed, and elapsed time."""
    periods = (last.periods - first.periods) + (last.missed - first.missed)
    return abs(periods / rate_hz / (last.at_s - first.at_s) - 1.0)


def bounds(
    samples: Mapping[str, Sequence[float]],
    counts: Counter[str],
    control_loop: tuple[CycleLook, CycleLook, float],
    ending: Counter[str],
) -> Iterator[Bound]:
    """All that is asked of a run.

    Args:
        samples: by name, of equal length; ``time_s`` among them.
        counts: what the clients counted, added up.
        cycle: first and last look, and the rate in Hz that it should have.
        ending: exit status, and lines of the log that tell of errors.
    """
    times_s = samples["time_s"]
    yield Bound("growth of memory", growth(times_s, samples["rss_mib"]), RSS_MIB, "MiB")
    for what in ("threads", "fds", "shm_files"):
        yield Bound(f"growth of {what}", growth(times_s, samples[what]), COUNT)
    yield Bound("goals without a result", counts["goals"] - counts["results"], 0)
    yield Bound("goals that ended unexpectedly", counts["unexpected"], 0)
    yield Bound("services without an answer", counts["calls"] - counts["answered"], 0)
    yield Bound("services rejected", counts["rejected"], 0)
    yield Bound("drift of the cycle", drift(*control_loop), DRIFT)
    for what, number in ending.items():
        yield Bound(what, number, 0)


def _thinned(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """No more than ``FIT_SAMPLES``: the pairs of all samples of an hour are too many."""
    return values[:: max(1, len(values) // FIT_SAMPLES)]
