"""``python -m tests.canopen.bench``: cost of a frame, and of six axes at a SYNC of 4 ms."""

# ruff: noqa: T201 - it prints its report

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import cast

import can
import numpy as np
from tests.canopen.rig import Rig

from robotd.clock import MonotonicClock
from robotd.descriptor import load_robot_descriptor
from robotd.plugin.manager import load_backend
from robotd.robot import Robot
from robotd_canopen.bus import Bus, frame
from robotd_canopen.feedback import Feedback
from robotd_canopen.layout import plan_network
from robotd_canopen.options import BusOptions, CanopenOptions

FRAMES = 20_000
CYCLE_S = 10.0


def made() -> Robot:
    descriptor = load_robot_descriptor("cr3a", "canopen_simulated")
    return Robot(descriptor, load_backend("canopen"), MonotonicClock())


def per_second(count: int, work: Callable[[], None]) -> float:
    began = time.perf_counter()
    work()
    return count / (time.perf_counter() - began)


def receiving() -> tuple[float, float]:
    """Frames per second that one core receives: bare python-can, and through the backend."""
    robot = load_robot_descriptor("cr3a", "canopen_simulated")
    section = CanopenOptions.model_validate(robot.backends["canopen"])
    layout = plan_network(robot, section)
    feedback = Feedback(layout.axes, 0.004, 0.1)
    source = can.Bus(interface="virtual", channel="bench")
    bare = can.Bus(interface="virtual", channel="bench")
    bus = Bus(BusOptions(interface="virtual", channel="bench"), MonotonicClock())
    for number, axis in enumerate(layout.axes):
        for pdo in axis.tpdos:
            bus.subscribe(pdo.cob_id, feedback.handler(number, pdo))
    frames = [frame(pdo.cob_id, bytes(8)) for axis in layout.axes for pdo in axis.tpdos]

    def fill() -> None:
        for number in range(FRAMES):
            source.send(frames[number % len(frames)])

    def drain_bare() -> None:
        for _ in range(FRAMES):
            bare.recv(1.0)

    fill()
    bare_rate = per_second(FRAMES, drain_bare)
    bare.shutdown()
    backend = can.Bus(interface="virtual", channel="bench")
    fill()
    ending = cast(threading.Event, UntilReceived(bus))
    rate = per_second(FRAMES, lambda: bus._receive(backend, ending))
    backend.shutdown()
    source.shutdown()
    return bare_rate, rate


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
    sink = can.Bus(interface="virtual", channel="bench-send")
    bare = can.Bus(interface="virtual", channel="bench-send")
    message = frame(0x201, bytes(7))

    def send_bare() -> None:
        for _ in range(FRAMES):
            bare.send(message)

    bare_rate = per_second(FRAMES, send_bare)
    bare.shutdown()
    bus = Bus(BusOptions(interface="virtual", channel="bench-send"), MonotonicClock())
    bus.open()
    rig = Robot(
        load_robot_descriptor("cr3a", "canopen_simulated"),
        load_backend("canopen"),
        MonotonicClock(),
    )
    axis = Rig(rig).master.axes[0]

    def send() -> None:
        for _ in range(FRAMES):
            axis.transmit(bus, 0.004)

    rate = per_second(FRAMES, send)
    bus.close()
    sink.shutdown()
    return bare_rate, rate


def cycle() -> None:
    """Period error and processor time of six moving axes at 250 Hz, without the simulation's."""
    robot = Robot(
        load_robot_descriptor("cr3a", "canopen_simulated"),
        load_backend("canopen"),
        MonotonicClock(),
    )
    rig = Rig(robot)
    robot.start()
    starts: list[int] = []
    robot.cycle.every(250, "bench", lambda image: starts.append(time.monotonic_ns()))
    ident = rig.network._thread.ident
    assert ident is not None
    clock = time.pthread_getcpuclockid(ident)
    began, cpu, sim = time.monotonic(), time.process_time(), time.clock_gettime(clock)
    missed = robot.cycle.stats.missed
    with robot.follower.follow(rig.request(CYCLE_S, 1.0)) as execution:
        execution.wait(CYCLE_S + 5)
    wall = time.monotonic() - began
    mine = time.process_time() - cpu - (time.clock_gettime(clock) - sim)
    simulated = (time.clock_gettime(clock) - sim) / wall
    error_ms = np.abs(np.diff(starts) - 4e6) / 1e6
    print(f"cycle: {execution.outcome}, {len(starts) / wall:.1f} periods/s,")
    print(
        f"  period error p50 {np.percentile(error_ms, 50):.3f} ms,"
        f" p99 {np.percentile(error_ms, 99):.3f} ms, missed {robot.cycle.stats.missed - missed}"
    )
    print(f"  daemon {mine / wall:.1%} of a core, simulated drives {simulated:.1%}")
    robot.shutdown()


def main() -> None:
    for name, (bare, through) in (("receive", receiving()), ("send", sending())):
        print(
            f"{name}: bare python-can {bare:.0f}/s, through the backend {through:.0f}/s"
            f" ({through / bare:.0%})"
        )
    cycle()


if __name__ == "__main__":
    main()
