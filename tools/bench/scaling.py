"""``python -m tools.bench.scaling``: how the cost grows with axes, rates and robots."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import click
import matplotlib as mpl
from tools.bench.machine import machine
from tools.bench.results import into_page, keep, out_option, table, told
from tools.bench.scaling_runs import HELD_PERCENT, Run, holds, measure, physics_runs, runs

mpl.use("Agg")
from matplotlib import pyplot as plt

COLUMNS = {
    "backend": ("backend", "{}"),
    "axes": ("axes", "{:d}"),
    "rate Hz": ("rate_hz", "{:d}"),
    "robots": ("robots", "{:d}"),
    "start s": ("start_s", "{:.1f}"),
    "CPU % of a core": ("cpu_percent", "{:.1f}"),
    "deadlines kept %": ("met_percent", "{:.2f}"),
    "late p50 µs": ("lateness_p50_us", "{:.0f}"),
    "p99 µs": ("lateness_p99_us", "{:.0f}"),
    "RSS MiB": ("rss_mib", "{:.0f}"),
    "PSS MiB": ("pss_mib", "{:.0f}"),
    "× real time": ("times_real_time", "{:.0f}"),
}
GROWING = {"axes": "Axes at 500 Hz", "rate_hz": "Rate in Hz", "robots": "Robots at 500 Hz"}
Figures = dict[str, Any]


@click.command()
@click.option("--seconds", default=10.0, show_default=True, help="Length of each measurement.")
@out_option
@click.option("--axes", "only", flag_value="axes", help="Only the runs with more and more axes.")
@click.option("--rates", "only", flag_value="rate_hz", help="Only those at higher rates.")
@click.option("--robots", "only", flag_value="robots", help="Only those with more robots.")
@click.option("--physics", "only", flag_value="backend", help="Only axes with physics.")
def main(seconds: float, out: Path, only: str | None) -> None:
    """Measure simulated robots at rest, servos on, that publish at the rate of their cycle.

    Writes scaling.json and scaling.png, and the table into scaling.md where that is there; with
    --physics physics.json, and the table into physics.md.
    """
    has_physics = only == "backend"
    results: dict[str, Any] = {"machine": machine(), "seconds": seconds, "runs": [], "notes": []}
    with tempfile.TemporaryDirectory(prefix="robotd-scaling-") as folder:
        for run in physics_runs() if has_physics else _chosen(only):
            click.echo(f"{run}", err=True)
            try:
                results["runs"].append(measure(run, seconds, Path(folder)))
            except (RuntimeError, OSError) as error:
                results["notes"].append(f"{run} could not be measured")
                click.echo(f"{run}: {error}", err=True)
    results["load_after"] = os.getloadavg()[0]
    report = "\n".join(_report(results))
    click.echo(report)
    name = "physics" if has_physics else "scaling"
    keep(out, name, results)
    into_page(out / f"{name}.md", report)
    if not has_physics:
        _draw(results["runs"], out / "scaling.png")


def _chosen(only: str | None) -> list[Run]:
    """Return the runs in which ``only`` grows, or all."""
    usual = getattr(Run(), only) if only else None
    return [run for run in runs() if not only or getattr(run, only) != usual or run == Run()]


def _report(results: dict[str, Any]) -> Iterator[str]:
    """Lines of Markdown: of what, the table, and where each stops to hold its rate."""
    facts, found = results["machine"], results["runs"]
    yield f"{told(facts)}, after {results['load_after']:.2f}; {results['seconds']:g} s each."
    yield ""
    yield table(COLUMNS, found)
    yield ""
    backends = {row["backend"] for row in found}
    for key, what in GROWING.items() if backends == {"sim"} else ():
        if series := _series(found, key):
            yield f"- {_end(series, key, what)}"
    yield from (f"- {note}" for note in results["notes"])


def _end(series: Sequence[Figures], key: str, what: str) -> str:
    """Up to where the rate was held."""
    failing = next((row for row in series if not holds(row)), None)
    if failing is None:
        return f"{what}: held up to {series[-1][key]}, {HELD_PERCENT:g} % of the deadlines at least"
    return (
        f"{what}: no longer held at {failing[key]}, {failing['met_percent']:.1f} % of the deadlines"
    )


def _series(found: Sequence[Figures], key: str) -> list[Figures]:
    """The runs in which ``key`` alone grows, in its order."""
    usual = {name: getattr(Run(), name) for name in (*GROWING, "backend") if name != key}
    chosen = [row for row in found if all(row[name] == value for name, value in usual.items())]
    return sorted(chosen, key=lambda row: row[key])


def _draw(found: Sequence[Figures], path: Path) -> None:
    """CPU and lateness over each of the three; hollow where the rate was not held."""
    figure, panels = plt.subplots(2, 3, figsize=(13, 7), squeeze=False)
    for column, key in enumerate(GROWING):
        series = _series(found, key)
        _curve(panels[0][column], series, key, {"CPU of one robot (% of a core)": "cpu_percent"})
        late = {"lateness p50 (µs)": "lateness_p50_us", "p99 (µs)": "lateness_p99_us"}
        _curve(panels[1][column], series, key, late)
        panels[1][column].set(yscale="log", ylim=(10.0, None))
    figure.tight_layout()
    figure.savefig(path, dpi=100)
    plt.close(figure)


def _curve(panel: Any, series: Sequence[Figures], key: str, values: dict[str, str]) -> None:
    at = [row[key] for row in series]
    for label, name in values.items():
        (line,) = panel.plot(at, [row[name] for row in series], label=label)
        for row in series:
            face = line.get_color() if holds(row) else "white"
            panel.plot(row[key], row[name], "o", color=line.get_color(), markerfacecolor=face)
    panel.set(
        ylim=(0.0, None),
        xlabel=key.replace("_hz", " (Hz)"),
        xscale="log",
        xticks=at,
        xticklabels=at,
    )
    panel.minorticks_off()
    panel.grid(alpha=0.3)
    panel.legend(fontsize=8)


if __name__ == "__main__":
    main()
