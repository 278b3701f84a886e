"""``python -m tools.bench.canopen``: cost of a frame, and of six axes at a SYNC of 4 ms.

On the virtual bus of python-can. What the simulated drives of the process take is subtracted.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import cast

import can
import click
import numpy as np
from tests.plugins.canopen.bus.harness import Harness
from tools.bench.machine import machine
from tools.bench.results import keep, out_option

from robotd.clock import MonotonicClock
from robotd.control.loop.setpoint_source import Outcome
from robotd.descriptor import load_robot_descriptor
from robotd.plugin.manager import load_backend
from robotd.robot import Robot
from robotd_canopen.bus import Bus
from robotd_canopen.feedback import Feedback
from robotd_canopen.frame import Frame
from robotd_canopen.layout import plan_network
from robotd_canopen.master import SyncProducer
from robotd_canopen.options import BusOptions, CanopenOptions
from robotd_cia402.scaling import Scaling

FRAMES = 5_000
RUNS = 5
CYCLE_S = 10.0
RATE_HZ = 250

Figures = dict[str, float]


def made() -> Robot:
    descriptor = load_robot_descriptor("cr3a", "canopen_simulated")
    return Robot(descriptor, load_backend("canopen"), MonotonicClock())


def per_second(count: int, work: Callable[[], None]) -> float:
    began = time.perf_counter()
    work()
    return count / (time.perf_counter() - began)


def best(measure: Callable[[], tuple[float, float]]) -> tuple[float, float]:
    """The highest rates of several runs: a busy computer makes work slower, never faster."""
    rates = [measure() for _ in range(RUNS)]
    return max(bare for bare, _ in rates), max(through for _, through in rates)


def receiving() -> tuple[float, float]:
    """Frames per second that one core receives: bare python-can, and through the backend."""
    robot = load_robot_descriptor("cr3a", "canopen_simulated")
    section = CanopenOptions.model_validate(robot.backends["canopen"])
    layout = plan_network(robot, section)
    feedback = Feedback(layout.axes, 0.004, 0.1)
    frames = [Frame(pdo.cob_id, bytes(8)) for axis in layout.axes for pdo in axis.tpdos]
    with (
        can.Bus(interface="virtual", channel="bench") as source,
        can.Bus(interface="virtual", channel="bench") as sink,
    ):
        bus = Bus(BusOptions(interface="virtual", channel="bench"))
        for number, axis in enumerate(layout.axes):
            for pdo in axis.tpdos:
                scaling = Scaling(axis.options, None)
                bus.subscribe(pdo.cob_id, feedback.handler(number, pdo, scaling))

        def fill() -> None:
            for number in range(FRAMES):
                source.send(frames[number % len(frames)])

        def drain_bare() -> None:
            for _ in range(FRAMES):
                sink.recv(1.0)

        fill()
        bare_rate = per_second(FRAMES, drain_bare)
        fill()
        ending = cast(threading.Event, UntilReceived(bus))
        return bare_rate, per_second(FRAMES, lambda: bus._receive(sink, ending))


class UntilReceived:
    """Ends the receive loop after the last frame, so that no thread and no time-out counts."""

    def __init__(self, bus: Bus) -> None:
        self._counters = bus.counters

    def is_set(self) -> bool:
        return self._counters.received >= FRAMES

    def wait(self, timeout_s: float) -> bool:
        return False


def sending() -> tuple[float, float]:
    """Frames per second that one core sends: bare python-can, and through the backend."""
    message = can.Message(arbitration_id=0x201, data=bytes(7), is_extended_id=False)
    axis = Harness(made()).master.axes[0]
    bus = Bus(BusOptions(interface="virtual", channel="bench-send"))
    with (
        can.Bus(interface="virtual", channel="bench-send"),
        can.Bus(interface="virtual", channel="bench-send") as bare,
    ):
        bus.open()
        axis.drive._bus = bus

        def send_bare() -> None:
            for _ in range(FRAMES):
                bare.send(message)

        def send() -> None:
            for _ in range(FRAMES):
                axis.transmit(0.004)

        try:
            return per_second(FRAMES, send_bare), per_second(FRAMES, send)
        finally:
            bus.close()


def control_loop() -> Figures:
    """Period error and processor time of six moving axes at 250 Hz, without the simulation's."""
    robot = made()
    harness = Harness(robot)
    robot.start()
    starts: list[int] = []
    robot.control_loop.every(
        RATE_HZ, "bench", lambda image: starts.append(time.monotonic_ns()), first=True
    )
    syncs = times_of_syncs(harness.master.sync)
    ident = harness.network._thread.ident
    assert ident is not None
    clock = time.pthread_getcpuclockid(ident)
    starts.clear()
    syncs.clear()
    began, cpu, sim = time.monotonic(), time.process_time(), time.clock_gettime(clock)
    missed = robot.control_loop.stats.missed
    with robot.follower.follow(harness.request(CYCLE_S, 1.0)) as execution:
        execution.wait(CYCLE_S + 5)
    wall_s = time.monotonic() - began
    simulated_s = time.clock_gettime(clock) - sim
    daemon_s = time.process_time() - cpu - simulated_s
    missed = robot.control_loop.stats.missed - missed
    rate_hz = 1e9 * (len(starts) - 1) / (starts[-1] - starts[0])
    errors = period_errors("period", starts) | period_errors("sync", syncs)
    robot.shutdown()
    return {
        "succeeded": float(execution.outcome is Outcome.SUCCEEDED),
        "rate_hz": rate_hz,
        **errors,
        "missed": float(missed),
        "daemon_cpu_percent": 100 * daemon_s / wall_s,
        "simulated_cpu_percent": 100 * simulated_s / wall_s,
    }


def times_of_syncs(sync: SyncProducer) -> list[int]:
    """Monotonic times at which SYNC is handed to the bus; grows while the robot runs."""
    times: list[int] = []
    send = sync.send

    def noted(*, withheld: bool = False) -> None:
        times.append(time.monotonic_ns())
        send(withheld=withheld)

    sync.send = noted  # type: ignore[method-assign]
    return times


def period_errors(what: str, times: list[int]) -> Figures:
    """Return the differences between the intervals of events and the period."""
    error_ms = np.abs(np.diff(times) - 1e9 / RATE_HZ) / 1e6
    return {f"{what}_error_p{part}_ms": float(np.percentile(error_ms, part)) for part in (50, 99)}


def targets(figures: Figures) -> list[dict[str, object]]:
    """Requirements of the backend, with the results."""
    receive = figures["receive_per_s"] / figures["receive_bare_per_s"]
    send = figures["send_per_s"] / figures["send_bare_per_s"]
    rows = [
        ("receive, share of bare python-can", receive, ">=", 0.5),
        ("send, share of bare python-can", send, ">=", 0.5),
        ("six axes: periods/s", figures["rate_hz"], ">=", 0.99 * RATE_HZ),
        ("six axes: period error p99 ms", figures["period_error_p99_ms"], "<", 0.5),
        ("six axes: SYNC error p99 ms", figures["sync_error_p99_ms"], "<", 0.5),
        ("six axes: daemon, % of a core", figures["daemon_cpu_percent"], "<", 35.0),
    ]
    return [
        {
            "name": name,
            "measured": measured,
            "limit": f"{sign} {limit:g}",
            "met": measured >= limit if sign == ">=" else measured < limit,
        }
        for name, measured, sign, limit in rows
    ]


@click.command()
@out_option
def main(out: Path) -> None:
    """Measure frames and six axes at a SYNC of 4 ms; write canopen.json."""
    where = machine()
    figures: Figures = {}
    for name, measure in (("receive", receiving), ("send", sending)):
        figures[f"{name}_bare_per_s"], figures[f"{name}_per_s"] = best(measure)
    figures |= control_loop()
    rows = targets(figures)
    for name, value in figures.items():
        print(f"{name:24} {value:.4g}")
    for row in rows:
        met = "met" if row["met"] else "NOT met"
        print(f"{row['name']:36} {row['measured']:8.3g}  {row['limit']:8} {met}")
    rounded = {name: float(f"{value:.4g}") for name, value in figures.items()}
    load = {"load_after": os.getloadavg()[0]}
    results = {"machine": where, **load, "figures": rounded, "targets": rows}
    keep(out, "canopen", results)


if __name__ == "__main__":
    main()
