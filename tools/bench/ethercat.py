"""``python -m tools.bench.ethercat``: frames of six drives at 250, 500 and 1000 Hz.

Against the simulated slaves on a virtual cable: period and lateness of the frames and the processor
time of robotd while six axes move, and of a bare loop of pysoem that exchanges the same data. Both
take turns; medians of the rounds.
"""

from __future__ import annotations

import os
import struct
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import click
import numpy as np
import pysoem
from tools.bench.machine import machine
from tools.bench.results import keep, out_option

from robotd.clock import MonotonicClock
from robotd.control.loop.setpoint_source import Outcome
from robotd.descriptor import RobotDescriptor, load_robot_descriptor
from robotd.motion import TrajectoryRequest
from robotd.plugin.manager import load_backend
from robotd.realtime import request_realtime
from robotd.robot import Robot
from robotd_cia402.device import Cia402Device
from robotd_ethercat.master import Master
from robotd_ethercat.slaves_process import Simulation

RATES_HZ = (250, 500, 1000)
CYCLE_S = 10.0
START_TIMEOUT_S = 10.0
ROUNDS = 3
WARM_UP = 300  # frames, until the phase of the frames is that of the middle
ROBOT, VARIANT = "cr3a", "ethercat_simulated"
MAX_RATIO, MAX_LATENESS_MS = 1.5, 0.1

Figures = dict[str, float]


def described(rate_hz: int) -> RobotDescriptor:
    robot = load_robot_descriptor(ROBOT, VARIANT)
    cycle = robot.cycle.model_copy(update={"rate_hz": float(rate_hz)})
    return robot.model_copy(update={"cycle": cycle})


def through_robotd(rate_hz: int) -> Figures:
    """Six axes follow a trajectory; the frames are recorded where they are handed to SOEM."""
    robot = Robot(described(rate_hz), load_backend("ethercat"), MonotonicClock())
    device = cast("Cia402Device[Master, Simulation]", vars(robot.connection._driver)["wrapped"])
    robot.start()
    try:
        times = noted(device.master.bus)
        request = TrajectoryRequest.from_rows(robot.joint_names, [CYCLE_S], [[0.5] * 6])
        began, cpu = time.monotonic(), time.process_time()
        with robot.follower.follow(request) as execution:
            execution.wait(CYCLE_S + 5.0)
        wall_s, cpu_s = time.monotonic() - began, time.process_time() - cpu
        counters = device.master.exchange.counters
        return {
            "succeeded": float(execution.outcome is Outcome.SUCCEEDED),
            "lost_frames": float(counters.lost + counters.incomplete),
            "cpu_percent": 100 * cpu_s / wall_s,
            **frame_errors(times, rate_hz),
        }
    finally:
        robot.shutdown()


def bare(rate_hz: int) -> Figures:
    """Bring the drives to Op with robotd, then exchange with nothing but pysoem and struct."""
    robot = Robot(described(rate_hz), load_backend("ethercat"), MonotonicClock())
    device = cast("Cia402Device[Master, Simulation]", vars(robot.connection._driver)["wrapped"])
    device.open()
    try:
        master = device.master
        master.bring_up.start(START_TIMEOUT_S)
        layouts = [
            (raw, struct.Struct(f"<{len(raw.input)}B"), struct.Struct(f"<{len(raw.output)}B"))
            for raw in cast(Any, master.bus.slaves)
        ]
        request_realtime(robot.descriptor.cycle.realtime_priority)
        times: list[int] = []
        began, cpu = time.monotonic(), time.process_time()
        lost = exchange(cast(pysoem.Master, master.bus._master), layouts, rate_hz, times)
        wall_s, cpu_s = time.monotonic() - began, time.process_time() - cpu
        figures = {"lost_frames": float(lost), "cpu_percent": 100 * cpu_s / wall_s}
        return {**figures, **frame_errors(times, rate_hz)}
    finally:
        device.close()


def exchange(
    master: pysoem.Master, layouts: list[tuple[Any, Any, Any]], rate_hz: int, times: list[int]
) -> int:
    """Receive, send, decode and encode in each period; return the lost frames.

    The frame leaves before the work, so that none is more punctual; unlike robotd, the loop does
    not wait for its return.
    """
    lost = 0
    period_ns = 1_000_000_000 // rate_hz
    outputs = [bytes(packed.size) for _, _, packed in layouts]
    master.send_processdata()
    due_ns = time.monotonic_ns()
    for _ in range(round(CYCLE_S * rate_hz)):
        due_ns += period_ns
        time.sleep(max(0, due_ns - time.monotonic_ns()) / 1e9)
        lost += master.receive_processdata(100) <= 0
        times.append(time.monotonic_ns())
        master.send_processdata()
        for (raw, unpacked, packed), output in zip(layouts, outputs, strict=True):
            unpacked.unpack(raw.input)
            raw.output = packed.pack(*output)
    return lost


def noted(bus: Any) -> list[int]:
    """Monotonic times at which frames are handed to SOEM; grows while the robot runs."""
    times: list[int] = []
    send: Callable[[], None] = bus.send

    def timed() -> None:
        times.append(time.monotonic_ns())
        send()

    bus.send = timed
    return times


def frame_errors(times: list[int], rate_hz: int) -> Figures:
    """Deviation of the intervals from the period, and lateness on the grid of least lateness."""
    sent = np.array(times[WARM_UP:], np.int64)
    period_ns = 1e9 / rate_hz
    error_us = np.abs(np.diff(sent) - period_ns) / 1e3
    phase_ns = (sent - sent[0] + period_ns / 2) % period_ns
    late_us = (phase_ns - np.percentile(phase_ns, 1)) / 1e3
    figures = {"rate_hz": 1e9 * (len(sent) - 1) / float(sent[-1] - sent[0])}
    for part in (50, 99):
        figures[f"period_error_p{part}_us"] = float(np.percentile(error_us, part))
        figures[f"lateness_p{part}_us"] = float(np.percentile(late_us, part))
    return figures


def targets(figures: dict[str, Figures]) -> list[dict[str, object]]:
    """Goals of the backend at each rate, with the results. Nothing fails: a miss is shown."""
    rows = []
    for rate_hz in RATES_HZ:
        ours, theirs = figures[f"robotd-{rate_hz}"], figures[f"bare-{rate_hz}"]
        ratio = ours["cpu_percent"] / theirs["cpu_percent"]
        late_ms = (ours["lateness_p99_us"] - theirs["lateness_p99_us"]) / 1e3
        rows += [
            (f"{rate_hz} Hz: processor time, ratio to bare pysoem", ratio, MAX_RATIO),
            (f"{rate_hz} Hz: lateness p99 over bare pysoem, ms", late_ms, MAX_LATENESS_MS),
        ]
    return [
        {"name": name, "measured": value, "limit": f"<= {limit:g}", "met": value <= limit}
        for name, value, limit in rows
    ]


def measured(rate_hz: int, rounds: int) -> dict[str, Figures]:
    """Median figures of both loops, which take turns."""
    runs: dict[str, list[Figures]] = {f"bare-{rate_hz}": [], f"robotd-{rate_hz}": []}
    for _ in range(rounds):
        for name, run in zip(runs, (bare, through_robotd), strict=True):
            runs[name].append(run(rate_hz))
    return {
        name: {key: float(np.median([one[key] for one in done])) for key in done[0]}
        for name, done in runs.items()
    }


@click.command()
@out_option
@click.option("--rounds", default=ROUNDS, show_default=True, type=click.IntRange(1))
def main(out: Path, rounds: int) -> None:
    """Measure frames of six drives at 250, 500 and 1000 Hz; write ethercat.json."""
    where = machine()
    figures: dict[str, Figures] = {}
    for rate_hz in RATES_HZ:
        figures |= measured(rate_hz, rounds)
    rows = targets(figures)
    for name, found in figures.items():
        text = ", ".join(f"{key} {value:.4g}" for key, value in found.items())
        print(f"{name:12} {text}")
    for row in rows:
        met = "met" if row["met"] else "NOT met"
        print(f"{row['name']:52} {row['measured']:8.3g}  {row['limit']:8} {met}")
    load = {"load_after": os.getloadavg()[0]}
    rounded = {
        name: {key: float(f"{value:.4g}") for key, value in found.items()}
        for name, found in figures.items()
    }
    keep(out, "ethercat", {"machine": where, **load, "figures": rounded, "targets": rows})


if __name__ == "__main__":
    main()
