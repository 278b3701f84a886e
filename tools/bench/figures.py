"""The two pictures: periods, and latency."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from tools.bench.scenario import Measured

mpl.use("Agg")
from matplotlib import pyplot as plt


def draw(measured: Mapping[str, Measured], folder: Path) -> None:
    """``period.png`` and ``latency.png``, a panel for each rate."""
    rates = sorted({measurement.rate_hz for measurement in measured.values()})
    kinds = list(dict.fromkeys(_kind(name, measurement) for name, measurement in measured.items()))
    for file, plot, label in (
        ("period.png", _histogram, "period error (ms)"),
        ("latency.png", _distribution, "stamp to subscriber (µs)"),
    ):
        figure, panels = plt.subplots(1, len(rates), figsize=(6.5 * len(rates), 4), squeeze=False)
        for panel, rate_hz in zip(panels[0], rates, strict=True):
            for name, measurement in measured.items():
                if measurement.rate_hz == rate_hz:
                    plot(
                        panel,
                        measurement,
                        label=name,
                        color=f"C{kinds.index(_kind(name, measurement))}",
                    )
            panel.set(title=f"{rate_hz} Hz", xlabel=label)
            panel.grid(alpha=0.3)
            panel.legend(fontsize=8)
        figure.tight_layout()
        figure.savefig(folder / file, dpi=110)
        plt.close(figure)


def _kind(name: str, measured: Measured) -> str:
    """The name without the rate: the same colour in every panel."""
    return name.replace(str(measured.rate_hz), "")


def _histogram(panel: Any, measured: Measured, **line: str) -> None:
    error_ms = measured.period_us / 1000.0 - 1000.0 / measured.rate_hz
    edges = np.linspace(-1.0, 1.0, 161)
    panel.hist(np.clip(error_ms, -1.0, 1.0), edges, histtype="step", **line)
    panel.set(yscale="log", ylabel="periods (those beyond ±1 ms at the edges)")


def _distribution(panel: Any, measured: Measured, **line: str) -> None:
    ordered = np.sort(measured.latency_us)
    panel.plot(ordered, np.arange(1, len(ordered) + 1) / len(ordered), **line)
    panel.set(xscale="log", ylabel="share of the messages", ylim=(0.0, 1.0))
