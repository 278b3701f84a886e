"""Streamed motion: lag, ripple, steps of a takeover, cost of a setpoint, and a picture.

``python -m tools.bench.streams``: a simulated CR3A on a stepped clock, so that everything but the
cost is the same in every run.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import click
import matplotlib as mpl
import numpy as np
from tools.bench.machine import machine
from tools.bench.results import keep, out_option

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS
from robotd.clock.simulated import SteppedClock
from robotd.control.sources.stream_source import StreamCommand, StreamMode, StreamSetpoints
from robotd.device.motion_limits import MotionLimits
from robotd.log import configure_logging
from robotd.motion import MotionState, TrajectoryRequest
from robotd.robot import Robot, build_robot, open_robot

mpl.use("Agg")
from matplotlib import pyplot as plt

AMPLITUDE, ANGULAR = 0.4, 2.0 * np.pi * 0.4
RATES_HZ = (10, 30, 100, 500)
SECONDS = 7.5  # three periods of the sine; the first is not judged
LOOP_HZ, COST_PERIODS, REPETITIONS = 1000, 3000, 12
EVICTING_VALUES = 2**19  # 4 MiB, written between two periods: more than the caches of a core
GOAL_AHEAD_S = 0.12  # of the goals that are sent instead: about the shortest accepted


class Run:
    """A robot and the setpoints that its device got."""

    def __init__(self, robot: Robot, clock: SteppedClock) -> None:
        self.robot, self.clock = robot, clock
        self.rows: list[tuple[float, ...]] = []
        driver = robot.control_loop._mixer._driver
        stream = driver.stream

        def record(position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            stream(position, velocity, due_ns)
            self.rows.append((due_ns / NANOSECONDS, position[0], velocity[0]))

        driver.stream = record  # type: ignore[method-assign]

    @property
    def now_s(self) -> float:
        return self.clock.now_ns() / NANOSECONDS

    def pass_time(self, seconds: float) -> None:
        self.clock.sleep_until_ns(self.clock.now_ns() + round(seconds * NANOSECONDS))

    def send_sine(self, rate_hz: float, send: Callable[[list[float]], None]) -> FloatArray:
        """Send targets for ``SECONDS``; rows of time, position, velocity, acceleration."""
        began_s, first = self.now_s, len(self.rows)
        for index in range(round(SECONDS * rate_hz)):
            send([AMPLITUDE * np.sin(ANGULAR * index / rate_hz)] * 6)
            self.pass_time(1.0 / rate_hz)
        rows = np.array(self.rows[first:])
        rows[:, 0] -= began_s
        return np.column_stack((rows, np.gradient(rows[:, 2], rows[:, 0])))


@contextmanager
def running() -> Iterator[Run]:
    clock = SteppedClock()
    with open_robot("cr3a", "sim", clock=clock) as robot:
        yield Run(robot, clock)


def judged(rows: FloatArray) -> dict[str, float]:
    """Return lag and ripple against the sine that fits best."""
    rows = rows[rows[:, 0] > 2.5]
    waves = np.column_stack((np.sin(ANGULAR * rows[:, 0]), np.cos(ANGULAR * rows[:, 0])))
    (sine, cosine), velocity = (np.linalg.lstsq(waves, rows[:, i])[0] for i in (1, 2))
    return {
        "lag_ms": float(-np.arctan2(cosine, sine) / ANGULAR * 1e3),
        "amplitude_rad": float(np.hypot(sine, cosine)),
        "ripple_rad_s": float(np.sqrt(np.mean((rows[:, 2] - waves @ velocity) ** 2))),
    }


def setpoint_cost(rate_hz: float, mode: str, *, cold: bool) -> tuple[float, float]:
    """Return p50 and p99 in µs of a setpoint of six joints at ``LOOP_HZ``, without interruptions.

    ``cold``: with the caches of the core cold in each period, as in operation.

    The same sequence runs ``REPETITIONS`` times, and the shortest time of each period counts:
    what interrupts this thread on a busy computer does so in other periods each time.
    """
    limits = build_robot("cr3a", "sim").follower.limits
    period_ns = NANOSECONDS // LOOP_HZ
    shortest = np.full(COST_PERIODS, np.inf)
    evicting = np.zeros(EVICTING_VALUES)
    for _ in range(REPETITIONS):
        setpoints = StreamSetpoints(limits, StreamMode(mode), 1.0 / LOOP_HZ, MotionLimits())
        setpoints.reset(MotionState.at_rest(np.zeros(6)))
        sent = 0
        for period in range(COST_PERIODS):
            now_ns = period * period_ns
            if cold:
                evicting += 1.0
            began_ns = time.perf_counter_ns()
            if now_ns >= sent * NANOSECONDS / rate_hz:
                target = np.full(6, AMPLITUDE * np.sin(ANGULAR * sent / rate_hz))
                setpoints.take(StreamCommand(target, None, now_ns))
                sent += 1
            setpoints.advance(now_ns + period_ns)
            shortest[period] = min(shortest[period], (time.perf_counter_ns() - began_ns) / 1e3)
    p50, p99 = np.percentile(shortest, (50, 99)).tolist()
    return p50, p99


def setpoint_costs(rate_hz: float, mode: str) -> dict[str, float]:
    """Return the times of ``setpoint_cost`` by name."""
    p50, p99 = setpoint_cost(rate_hz, mode, cold=False)
    cold_p50, cold_p99 = setpoint_cost(rate_hz, mode, cold=True)
    return {
        "cost_p50_us": p50,
        "cost_p99_us": p99,
        "cost_cold_p50_us": cold_p50,
        "cost_cold_p99_us": cold_p99,
    }


def by_stream(rate_hz: float, mode: str) -> tuple[FloatArray, dict[str, float]]:
    with running() as run, run.robot.stream(mode=mode, timeout_s=0.3) as stream:
        rows = run.send_sine(rate_hz, stream.send)
    return rows, judged(rows) | setpoint_costs(rate_hz, mode)


def by_goals(rate_hz: float) -> tuple[FloatArray, dict[str, float]]:
    with running() as run, ExitStack() as goals:
        names = run.robot.joint_names

        def send(position: list[float]) -> None:
            request = TrajectoryRequest.from_rows(names, [GOAL_AHEAD_S], [position])
            goals.enter_context(run.robot.follower.follow(request))

        rows = run.send_sine(rate_hz, send)
    return rows, judged(rows)


def takeover() -> dict[str, float]:
    """Return the largest steps between a goal, a stream, and the next goal, all in motion."""
    with running() as run, ExitStack() as sources:
        run.robot.follower._takeover = True

        def go(target: float, seconds: float) -> None:
            request = TrajectoryRequest.from_rows(run.robot.joint_names, [seconds], [[target] * 6])
            sources.enter_context(run.robot.follower.follow(request))

        go(1.0, 2.0)
        run.pass_time(0.8)
        stream = sources.enter_context(run.robot.stream(takeover=True))
        for index in range(15):
            stream.send([0.5 + 0.02 * index] * 6, [0.6] * 6)
            run.pass_time(1 / 30)
        go(-0.5, 2.0)
        run.pass_time(1.0)
        time_s, position, velocity = np.array(run.rows).T
    period_s = float(np.median(np.diff(time_s)))
    limit = 12.57  # rad/s², of the CR3A
    travelled = np.diff(position) - (velocity[1:] + velocity[:-1]) / 2.0 * period_s
    steps = np.abs(np.diff(velocity)) - limit * period_s
    return {
        "position_step_rad": float(max(0.0, np.abs(travelled).max() - limit * period_s**2 / 6)),
        "velocity_step_rad_s": float(max(0.0, steps.max())),
        "slowest_rad_s": float(np.abs(velocity[len(velocity) // 8 : len(velocity) // 2]).min()),
    }


def draw(goals: FloatArray, stream: FloatArray, out: Path) -> None:
    """``stream.png``: the same sine by goals and by a stream."""
    figure, panels = plt.subplots(3, 2, figsize=(11, 7), sharex=True, sharey="row")
    labels = ("position (rad)", "velocity (rad/s)", "acceleration (rad/s²)")
    titles = ("30 goals a second, 0.12 s ahead", "a stream, 30 Hz, smooth")
    for column, (rows, title) in enumerate(zip((goals, stream), titles, strict=True)):
        time_s = rows[:, 0]
        wave = AMPLITUDE * np.array([
            np.sin(ANGULAR * time_s),
            ANGULAR * np.cos(ANGULAR * time_s),
            -(ANGULAR**2) * np.sin(ANGULAR * time_s),
        ])  # fmt: skip
        for row, panel in enumerate(panels[:, column]):
            panel.plot(time_s, wave[row], color="0.7", label="sent")
            panel.plot(time_s, rows[:, row + 1], lw=0.9, label="setpoints")
            panel.grid(alpha=0.3)
            if not column:
                panel.set(ylabel=labels[row])
        panels[0, column].set(title=title)
        panels[2, column].set(xlabel="time (s)", xlim=(2.5, 6.0))
    panels[0, 0].legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(out / "stream.png", dpi=100)
    plt.close(figure)


def show(name: str, rate_hz: int, figures: dict[str, float]) -> None:
    line = f"{name:10}{rate_hz:5} Hz{figures['lag_ms']:9.1f}{figures['ripple_rad_s']:14.4f}"
    if "cost_p50_us" in figures:
        line += f"{figures['cost_p50_us']:10.1f}{figures['cost_p99_us']:9.1f}"
        line += f"{figures['cost_cold_p50_us']:10.1f}{figures['cost_cold_p99_us']:9.1f}"
    print(line)


@click.command()
@out_option
def main(out: Path) -> None:
    """Measure streams; write streams.json and stream.png."""
    configure_logging("warning")
    results: dict[str, Any] = {"machine": machine(), "load": os.getloadavg()[0], "streams": {}}
    print(f"{'':18}{'lag ms':>9}{'ripple rad/s':>14}{'cost p50':>10}{'p99 µs':>9}{'cold':>10}")
    pictures = {}
    for mode in ("target", "smooth"):
        for rate_hz in RATES_HZ:
            rows, figures = by_stream(rate_hz, mode)
            pictures[mode, rate_hz] = rows
            results["streams"][f"{mode}-{rate_hz}"] = figures
            show(mode, rate_hz, figures)
    goals, figures = by_goals(30)
    results["goals-30"] = figures
    show("goals", 30, figures)
    results["takeover"] = takeover()
    print(
        "takeover: " + ", ".join(f"{key} {value:.2g}" for key, value in results["takeover"].items())
    )
    out.mkdir(parents=True, exist_ok=True)
    keep(out, "streams", results)
    draw(goals, pictures["smooth", 30], out)


if __name__ == "__main__":
    main()
