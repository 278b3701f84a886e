"""One subject, measured: start, round trips, then a window with one subscriber and its load."""

from __future__ import annotations

import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from std_srvs.srv import Trigger
from tools.bench.client import BenchClient
from tools.bench.percentiles import percentiles
from tools.bench.process import Program, fresh_environment
from tools.bench.subjects import Load, Subject
from wmx_ros2_message.srv import EcatGetNetworkState

from robotd_testing.domain import own_domain

SETTLE_S = 1.0
CALLS = 2000
GOALS = 30
STARTS = 5
PROFILE = Path(__file__).with_name("listener.xml")

Samples = NDArray[Any]


@dataclass(frozen=True)
class Measured:
    """Figures for the tables, and the samples that are drawn.

    Attributes:
        rate_hz: nominal.
        figures: by name; the unit is the end of the name.
        period_us: between two stamps of the joint states.
        latency_us: from stamp to callback of the subscriber.
    """

    rate_hz: int
    figures: dict[str, float]
    period_us: Samples
    latency_us: Samples


def measure(subject: Subject, seconds: float, folder: Path) -> Measured:
    """Run ``subject`` once and measure for ``seconds``. Raises RuntimeError when it fails."""
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    arrivals = folder / f"{subject.name}.npz"
    figures: dict[str, float] = {}
    if subject.load is Load.NONE:
        starts = [_start_s(subject, arrivals) for _ in range(STARTS)]
        figures |= {"start_s": float(np.median(starts)), "start_max_s": max(starts)}
    with own_domain() as domain, subscriber(domain, arrivals) as listener:
        with subject.program(domain) as program:
            listener.wait_output("first")
            program.wait_output(subject.ready)
            figures["rss_ready_mib"] = program.memory_mib()["rss_mib"]
            if subject.load is Load.NONE:
                figures |= _round_trips(subject, domain)
            window, usage = _window(subject, program, domain, seconds)
            program.stop()
            samples = subject.samples(program)
        listener.stop()
        received = np.load(arrivals)
    figures |= usage
    if samples is not None:
        figures |= _timing(samples, window, subject.rate_hz)
    return _received(received, window, subject.rate_hz, figures)


def _start_s(subject: Subject, arrivals: Path) -> float:
    """From spawning the process to its first joint state at the subscriber."""
    with own_domain() as domain, subscriber(domain, arrivals) as listener:
        with subject.program(domain) as program:
            listener.wait_output("first")
            program.wait_output(subject.ready)
        listener.stop()
        return float(np.load(arrivals)["arrived_ns"][0] - program.spawned_ns) * 1e-9


def subscriber(domain: int, arrivals: Path) -> Program:
    """The listener's process; ``arrivals`` is written when it is stopped.

    It announces itself often. Fast DDS answers a new process once, and when that comes too early
    the two meet at the next periodic announcement: up to 3 s that are not the subject's.
    """
    command = [sys.executable, "-m", "tools.bench.listener", str(arrivals)]
    environment = fresh_environment(domain) | {"FASTRTPS_DEFAULT_PROFILES_FILE": str(PROFILE)}
    return Program(command, environment, started="listening")


def _round_trips(subject: Subject, domain: int) -> dict[str, float]:
    with BenchClient(domain) as client:
        memory = client.round_trips_us(Trigger, subject.service, CALLS)
        figures = percentiles("service", memory)
        if subject.name.startswith("robotd"):
            worker = "/wmx/ecat/get_network_state"
            blocking = client.round_trips_us(EcatGetNetworkState, worker, CALLS)
            figures |= percentiles("worker_service", blocking)
            figures |= percentiles("goal_accepted", client.acceptance_us(GOALS))
    return figures


def _window(
    subject: Subject, program: Program, domain: int, seconds: float
) -> tuple[tuple[int, int], dict[str, float]]:
    """Monotonic begin and end in ns, and what the program used in between."""
    if subject.load is Load.NONE:
        return _idle_window(program, seconds)
    with BenchClient(domain) as client, client.load(subject.load) as times:
        window, usage = _idle_window(program, seconds)
        if subject.load is Load.BUSY:
            usage |= percentiles("service", np.array(times))
            usage["services_hz"] = len(times) / (seconds + SETTLE_S)
        if client.failures:
            raise RuntimeError(client.failures[0])
        return window, usage


def _idle_window(program: Program, seconds: float) -> tuple[tuple[int, int], dict[str, float]]:
    time.sleep(SETTLE_S)
    begin_ns, cpu_s = time.monotonic_ns(), program.cpu_s()
    time.sleep(seconds)
    end_ns, used_s = time.monotonic_ns(), program.cpu_s() - cpu_s
    usage = {"cpu_percent": 100.0 * used_s / ((end_ns - begin_ns) * 1e-9)}
    return (begin_ns, end_ns), usage | program.memory_mib()


def _timing(samples: dict[str, Any], window: tuple[int, int], rate_hz: int) -> dict[str, float]:
    """Periods in the window as the program recorded them."""
    begin_ns, end_ns = window
    start = np.array(samples["start_ns"])
    inside = (start >= begin_ns) & (start < end_ns)
    lateness_us = np.array(samples["lateness_ns"])[inside] / 1000.0
    execution_us = np.array(samples["execution_ns"])[inside] / 1000.0
    missed = int((lateness_us * rate_hz // 1e6).sum())
    due = len(lateness_us) + missed
    return {
        **percentiles("lateness", lateness_us),
        **percentiles("execution", execution_us),
        "periods": len(lateness_us),
        "missed": missed,
        "met_percent": 100.0 * (due - missed) / due if due else float("nan"),
    }


def _received(
    received: Any, window: tuple[int, int], rate_hz: int, figures: dict[str, float]
) -> Measured:
    """Messages in the window as the subscriber received them."""
    arrived = received["arrived_ns"]
    inside = (arrived >= window[0]) & (arrived < window[1])
    stamped = received["stamped_ns"][inside]
    period_us = np.diff(stamped) / 1000.0
    latency_us = (received["arrived_wall_ns"][inside] - stamped) / 1000.0
    nominal_us = 1e6 / rate_hz
    figures |= {
        "rate_hz": float(1e6 / period_us.mean()),
        **percentiles("period_error", abs(period_us - nominal_us)),
        **percentiles("arrival_error", abs(np.diff(arrived[inside]) / 1000.0 - nominal_us)),
        **percentiles("latency", latency_us),
    }
    return Measured(rate_hz, figures, period_us, latency_us)
