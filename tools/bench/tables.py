"""The report for people."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from tools.bench.targets import Figures, Target

# Heading → name of the figure. Times in µs unless the heading says otherwise.
TIMING = {
    "rate Hz": "rate_hz",
    "CPU %": "cpu_percent",
    "late p50": "lateness_p50_us",
    "p99": "lateness_p99_us",
    "max": "lateness_max_us",
    "missed": "missed",
    "exec p50": "execution_p50_us",
    " p99": "execution_p99_us",
    "period err p50": "period_error_p50_us",
    "  p99": "period_error_p99_us",
    "arrival err p50": "arrival_error_p50_us",
    "   p99": "arrival_error_p99_us",
}
CONTACT = {
    "latency p50": "latency_p50_us",
    "p99": "latency_p99_us",
    "service p50": "service_p50_us",
    " p99": "service_p99_us",
    "by worker p50": "worker_service_p50_us",
    "  p99": "worker_service_p99_us",
    "goal p50": "goal_accepted_p50_us",
    "   p99": "goal_accepted_p99_us",
    "start s": "start_s",
    "RSS MiB ready": "rss_ready_mib",
    "later": "rss_mib",
    "PSS MiB": "pss_mib",
}


def tables(results: dict[str, Any], targets: Sequence[Target]) -> Iterator[str]:
    """Every line of the report."""
    figures: Figures = results["subjects"]
    if figures:
        yield from ("", "Periods, times in µs", *_figures(figures, TIMING))
        yield from ("", "Contact with other processes, times in µs", *_figures(figures, CONTACT))
    for phase, parts in results["costs"].items():
        yield from ("", f"Cost of the parts of a period at 500 Hz, {phase}, µs", *_costs(parts))
    if results["planning"]:
        yield ""
        yield from (f"{name}: {value:.2f}" for name, value in results["planning"].items())
    if targets:
        yield from ("", "Targets", *target_lines(targets))


def _figures(figures: Figures, headings: dict[str, str]) -> Iterator[str]:
    rows = [["", *headings]]
    for name, values in figures.items():
        rows.append([name, *(_number(values.get(key)) for key in headings.values())])
    return aligned(rows)


def _costs(parts: dict[str, dict[str, float]]) -> Iterator[str]:
    rows = [["part (those below contain one another)", "p50", "p99", "mean per period"]]
    rows += [[name, *(f"{value:.1f}" for value in cells.values())] for name, cells in parts.items()]
    return aligned(rows)


def target_lines(targets: Sequence[Target]) -> Iterator[str]:
    """Yield a line for each target, with what was measured."""
    rows = [["", "measured", "target", "", ""]]
    for figure in targets:
        measured, target = _number(figure.measured), _number(figure.target)
        rows.append([figure.what, measured, target, figure.unit, "met" if figure.met else "MISSED"])
    return aligned(rows)


def _number(value: float | None) -> str:
    if value is None:
        return "–"
    return f"{value:.0f}" if abs(value) >= 100 or value == int(value) else f"{value:.2f}"


def aligned(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Columns: the first to the left, the others to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for first, *others in rows:
        cells = [other.rjust(width) for other, width in zip(others, widths[1:], strict=True)]
        yield "  ".join([first.ljust(widths[0]), *cells]).rstrip()
