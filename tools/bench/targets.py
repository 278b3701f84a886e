"""Targets of the figures. Nothing fails: a missed target is shown."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

Figures = dict[str, dict[str, float]]


@dataclass(frozen=True)
class Target:
    """``measured`` against ``target``, and whether it is met."""

    what: str
    measured: float
    target: float
    unit: str
    met: bool


def targets(figures: Figures, costs: dict[str, Any], planning: dict[str, float]) -> list[Target]:
    """Those whose figures are there."""
    rows = [
        *_against_c(figures, costs),
        *_of_the_daemon(figures),
        *_of_parts(costs, planning),
    ]
    return list(rows)


def at_most(what: str, measured: float, target: float, unit: str = "×") -> Target:
    return _target(what, measured, target, unit, operator.le)


def _target(
    what: str, measured: float, target: float, unit: str, met: Callable[[float, float], bool]
) -> Target:
    return Target(what, measured, target, unit, bool(met(measured, target)))


def _against_c(figures: Figures, costs: dict[str, Any]) -> Iterator[Target]:
    for rate_hz in (500, 1000):
        daemon, c = figures.get(f"robotd-{rate_hz}"), figures.get(f"c-{rate_hz}")
        if daemon is None or c is None:
            continue
        at = f"{rate_hz} Hz"
        if rate_hz == 500 and costs:
            read = costs["at rest"]["read"]["mean_us_per_period"] * rate_hz / 1e4
            ratio = (daemon["cpu_percent"] - read) / c["cpu_percent"]
            yield at_most(f"CPU without the simulation, {at}, to C", ratio, 1.3)
        for part, limit in (("lateness_p50", 1.25), ("lateness_p99", 1.25), ("latency_p50", 1.15)):
            ratio = daemon[f"{part}_us"] / c[f"{part}_us"]
            yield at_most(f"{part.replace('_', ' ')}, {at}, to C", ratio, limit)
        if rate_hz == 500:
            ratio = daemon["service_p50_us"] / c["service_p50_us"]
            yield at_most("service round trip p50, to C", ratio, 1.5)


def _of_the_daemon(figures: Figures) -> Iterator[Target]:
    for rate_hz, cpu in ((500, 12.0), (1000, 22.0)):
        name = f"robotd-{rate_hz}"
        if moving := figures.get(f"{name}-moving"):
            yield at_most(f"CPU while moving, {rate_hz} Hz", moving["cpu_percent"], cpu, "%")
        if busy := figures.get(f"{name}-busy"):
            late = busy["lateness_p99_us"]
            yield at_most(f"lateness p99 while busy, {rate_hz} Hz", late, 1000.0, "µs")
    if fast := figures.get("robotd-1000"):
        met = fast["met_percent"]
        yield _target("deadlines met, 1000 Hz", met, 99.9, "%", operator.ge)
    if daemon := figures.get("robotd-500"):
        yield at_most("process start to first joint state", daemon["start_s"], 0.7, "s")
        yield at_most("resident memory after goals", daemon["rss_mib"], 120.0, "MiB")


def _of_parts(costs: dict[str, Any], planning: dict[str, float]) -> Iterator[Target]:
    if costs:
        for phase in ("in a tight loop", "at rest", "moving"):
            yield at_most(f"read of six axes, {phase}", costs[phase]["read"]["p50_us"], 15.0, "µs")
    if planning:
        yield at_most("plan of 1000 points × 6 joints", planning["plan_1000x6_ms"], 20.0, "ms")
        ms = planning["parameters_128_axes_ms"]
        yield at_most("parameter file of 128 axes, 1 MB", ms, 150.0, "ms")
        ms = planning["program_200_steps_check_ms"]
        yield at_most("check of a program of 200 steps", ms, 1000.0, "ms")
        ms = planning["program_200_steps_start_ms"]
        yield at_most("start of it to motion", ms, 200.0, "ms")
