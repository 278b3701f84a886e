"""The picture of a soak: what must not grow, and how late the cycle was."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
from matplotlib import pyplot as plt

# Panel → name of the samples and label of the line.
PANELS = {
    "resident memory (MiB)": {"rss_mib": ""},
    "count": {"threads": "threads", "fds": "descriptors", "shm_files": "files of /dev/shm mapped"},
    "lateness (µs)": {"lateness_p50_us": "p50", "lateness_p99_us": "p99"},
    "per second": {"answered": "services answered", "results": "goals ended"},
}
RATE_WINDOW = 30  # samples


def draw(samples: Mapping[str, Sequence[float]], title: str, path: Path) -> None:
    """One panel below the other over the same minutes, as PNG."""
    minutes = np.asarray(samples["time_s"]) / 60.0
    figure, panels = plt.subplots(len(PANELS), 1, figsize=(9, 10), sharex=True)
    for panel, (label, lines) in zip(panels, PANELS.items(), strict=True):
        for name, text in lines.items():
            values = np.asarray(samples[name], dtype=float)
            if label == "per second":
                values = _rate(values, np.asarray(samples["time_s"]))
            panel.plot(minutes, values, label=text)
        panel.set(ylabel=label)
        panel.grid(alpha=0.3)
        if len(lines) > 1:
            panel.legend(fontsize=8)
    panels[2].set(yscale="log")
    panels[3].set(yscale="log")
    panels[0].set(title=title)
    panels[-1].set(xlabel="minutes")
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _rate(counts: np.ndarray, times_s: np.ndarray) -> np.ndarray:
    """Counts per second over a window; NaN where the window is not full or nothing came."""
    window = min(RATE_WINDOW, len(counts) - 1)
    rate = np.full(len(counts), np.nan)
    rate[window:] = (counts[window:] - counts[:-window]) / (times_s[window:] - times_s[:-window])
    return np.where(rate > 0.0, rate, np.nan)
