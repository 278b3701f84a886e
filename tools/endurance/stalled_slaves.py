"""Simulated EtherCAT slaves for ``stalls``, in another process than the robot."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import yaml
from tools.endurance.stalled_robot import MotorRecorder

from robotd.api import request_realtime
from robotd.descriptor import load_robot_descriptor
from robotd_ethercat.simulate_command import MASTER, SLAVES
from robotd_ethercat.simulated import Bus
from robotd_ethercat.simulated.virtual_cable import make_cable, new_namespace
from robotd_ethercat.simulated_robot import simulated_line

RATE_HZ = 250
STALE_AFTER_S = 1.0
PATIENCE = {"watchdog_ms": 1000, "stream_timeout_s": 1.0, "max_lost_frames": 100}


def write_robot(folder: Path) -> Path:
    """A file of the CR3A that finds its slaves behind ``MASTER``; its motors turn as its joints."""
    robot = load_robot_descriptor("cr3a")
    axes = [{**axis, "polarity": 1} for axis in robot.backends["ethercat"]["axes"]]
    section = {"interface": MASTER, "axes": axes, **PATIENCE}
    content = {
        "extends": str(robot.path),
        "engine": {"stale_after_s": STALE_AFTER_S},
        "default_variant": "stalled",
        "variants": {"stalled": {"cycle": {"rate_hz": RATE_HZ}, "backends": {"ethercat": section}}},
    }
    path = folder / "cr3a.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path


@contextmanager
def slaves(folder: Path) -> Iterator[tuple[str, MotorRecorder]]:
    """A CR3A's slaves behind a virtual cable; the robot file for them, and a recorder.

    This process, and those that it starts, are in a network namespace of their own from then on.
    """
    new_namespace()
    make_cable(MASTER, SLAVES)
    robot_file = write_robot(folder)
    robot = load_robot_descriptor(str(robot_file))
    line = simulated_line(robot)
    bus = Bus(line, SLAVES)

    def serve() -> None:
        request_realtime(max(1, robot.cycle.realtime_priority - 2))
        bus.run()

    thread = threading.Thread(target=serve, name="slaves")
    thread.start()
    motors = line._motion._machine  # type: ignore[union-attr]
    try:
        yield (
            str(robot_file),
            MotorRecorder.of_drives(motors),
        )
    finally:
        bus.stop()
        thread.join()
        bus.close()
