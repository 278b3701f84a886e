"""Metrics of a robot in the text format of Prometheus; needs prometheus_client."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager
from typing import Protocol

import numpy as np
from prometheus_client import CollectorRegistry, ProcessCollector, make_wsgi_app
from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    Metric,
)

from robotd.api import NANOSECONDS, IntArray
from robotd.api.features import OWN_PROCESS, EventKind, Tap
from robotd_shared.local_http import serve_http

BUCKETS_S = (10e-6, 30e-6, 100e-6, 300e-6, 1e-3, 3e-3, 10e-3, 30e-3, 100e-3)
MAX_LABELS = 64  # different values of a label; further ones are counted as "other"
REJECTED_GOAL = (EventKind.GOAL, "rejected")  # an accepted one is counted when it ends
BUS_COUNTERS = ("lost_frames", "timeouts", "late_cycles")


class SavedRecordings(Protocol):
    """Counts of a flight recorder: files saved, and lost."""

    saved: int
    failed: int


class Metrics:
    """Collector of one robot's metrics, for a registry of prometheus_client.

    ``update`` belongs to the tap's thread, ``collect`` to the one of the server. The frames are
    counted as they come, so that no period is missing between two scrapes.

    Args:
        tap: source of the counts.
        flight: its recordings are counted; None: there are none.
    """

    def __init__(self, tap: Tap, flight: SavedRecordings | None) -> None:
        self._tap, self._flight = tap, flight
        self._robot = tap.robot
        self._cursor = self._event_cursor = 0
        self._late = _Histogram()
        self._execution = _Histogram()
        self._faults: Counter[str] = Counter()
        self._stops: Counter[str] = Counter()
        self._senders: set[str] = set()
        tap.add_reader(self.update)

    def update(self) -> None:
        """Count the new frames and events."""
        frames, self._cursor, _ = self._tap.frames.since(self._cursor)
        self._late.add(frames["late_ns"])
        self._execution.add(frames["execution_ns"])
        events, self._event_cursor = self._tap.events.since(self._event_cursor)
        for event in events:
            if event.kind is EventKind.FAULT:
                _count(self._faults, event.subject)
            elif event.kind is EventKind.STOP and event.data["outcome"] == "stopped":
                _count(self._stops, event.text.partition(": ")[2])
            if event.sender not in ("", OWN_PROCESS) and len(self._senders) < MAX_LABELS:
                self._senders.add(event.sender)

    def collect(self) -> Iterator[Metric]:
        """Yield all metrics; called by the registry."""
        yield from self._loop_metrics()
        yield from self._state_metrics()
        yield from self._event_metrics()
        yield from self._bus_metrics()

    def _loop_metrics(self) -> Iterator[Metric]:
        stats = self._robot.control_loop.stats
        yield self._late.metric("robotd_loop_lateness_seconds", "Wake-up after the deadline.")
        yield self._execution.metric("robotd_loop_execution_seconds", "Work done in a period.")
        yield CounterMetricFamily(
            "robotd_loop_periods", "Periods of the control loop.", stats.cycles
        )
        yield CounterMetricFamily("robotd_loop_missed_deadlines", "Missed deadlines.", stats.missed)

    def _state_metrics(self) -> Iterator[Metric]:
        robot = self._robot
        fresh_ns = robot.image.fresh_ns
        age_s = (robot.clock.now_ns() - fresh_ns) / NANOSECONDS if fresh_ns else np.nan
        yield GaugeMetricFamily(
            "robotd_values_age_seconds", "Age of the newest values of the device.", age_s
        )
        yield GaugeMetricFamily(
            "robotd_ready", "1: the device takes commands.", robot.connection.ready
        )
        stopped = bool(robot.axes.stop_latch.reason)
        yield GaugeMetricFamily(
            "robotd_stopped", "1: all motion is stopped until a reset.", stopped
        )
        used = self._tap.nbytes
        yield GaugeMetricFamily(
            "robotd_recorder_memory_bytes", "Memory of the flight recorder.", used
        )
        yield GaugeMetricFamily(
            "robotd_clients", "Clients that have sent commands or goals.", len(self._senders)
        )

    def _event_metrics(self) -> Iterator[Metric]:
        counts = [*self._tap.events.counts.items()]  # any thread adds to them
        goals = {outcome: n for (kind, outcome), n in counts if kind is EventKind.RESULT}
        goals |= {name: n for (kind, name), n in counts if (kind, name) == REJECTED_GOAL}
        yield _labelled(
            CounterMetricFamily, "robotd_goals", "Goals that have ended.", "outcome", goals
        )
        commands = {name: n for (kind, name), n in counts if kind is EventKind.COMMAND}
        yield _labelled(
            CounterMetricFamily, "robotd_commands", "Commands of clients.", "outcome", commands
        )
        yield _labelled(
            CounterMetricFamily, "robotd_stops", "Stops of all motion.", "cause", self._stops
        )
        yield _labelled(
            CounterMetricFamily, "robotd_faults", "Alarms and lost drives.", "axis", self._faults
        )
        flight = self._flight
        saved = {"saved": flight.saved if flight else 0, "lost": flight.failed if flight else 0}
        yield _labelled(
            CounterMetricFamily, "robotd_recordings", "Flight recordings.", "outcome", saved
        )

    def _bus_metrics(self) -> Iterator[Metric]:
        groups = self._tap.fieldbus
        buses = {name: values for name, values in groups.items() if "/" not in name}
        for counter in BUS_COUNTERS:
            values = {name: bus[counter] for name, bus in buses.items() if counter in bus}
            text = f"Fieldbus: {counter.replace('_', ' ')}."
            yield _labelled(CounterMetricFamily, f"robotd_bus_{counter}", text, "bus", values)
        nodes = {name: group for name, group in groups.items() if "/" in name}
        offline = {name: node["offline"] for name, node in nodes.items()}
        yield _labelled(
            GaugeMetricFamily,
            "robotd_bus_node_offline",
            "1: the node does not answer.",
            "node",
            offline,
        )
        errors = {name: node["error_code"] for name, node in nodes.items()}
        yield _labelled(
            GaugeMetricFamily,
            "robotd_bus_node_error_code",
            "Error of the node, 0: none.",
            "node",
            errors,
        )


def serve_metrics(made: CollectorRegistry, port: int) -> AbstractContextManager[int]:
    """Serve ``/metrics`` on the loopback interface during the block; the value is the port.

    Raises OperationError: the port is in use.
    """
    return serve_http(make_wsgi_app(made), port, "metrics")


def registry(tap: Tap, flight: SavedRecordings | None) -> CollectorRegistry:
    """Return a registry of the robot's and the process's metrics; before the tap starts."""
    made = CollectorRegistry()
    ProcessCollector(registry=made)
    made.register(Metrics(tap, flight))
    return made


class _Histogram:
    """Cumulative histogram of durations."""

    def __init__(self) -> None:
        self._edges = np.array(
            [0, *(round(bound_s * NANOSECONDS) for bound_s in BUCKETS_S)], np.int64
        )
        self._counts = np.zeros(len(BUCKETS_S) + 1, np.int64)
        self._sum_ns = 0

    def add(self, durations_ns: IntArray) -> None:
        """Count durations; a bucket includes its upper edge."""
        places = np.searchsorted(self._edges[1:], durations_ns, side="left")
        self._counts += np.bincount(places, minlength=len(self._counts))
        self._sum_ns += int(durations_ns.sum())

    def metric(self, name: str, text: str) -> Metric:
        totals = np.cumsum(self._counts).tolist()
        edges = [*map(str, BUCKETS_S), "+Inf"]
        buckets = [*zip(edges, map(float, totals), strict=True)]
        return HistogramMetricFamily(name, text, buckets, self._sum_ns / NANOSECONDS)


def _count(counter: Counter[str], label: str) -> None:
    counter[label if label in counter or len(counter) < MAX_LABELS else "other"] += 1


def _labelled(
    kind: type[CounterMetricFamily | GaugeMetricFamily],
    name: str,
    text: str,
    label: str,
    values: Mapping[str, float],
) -> Metric:
    """Return a metric with one value for each value of ``label``."""
    family = kind(name, text, labels=[label])
    for key, value in [*values.items()]:  # the thread of the tap adds to them
        family.add_metric([key], value)
    return family
