"""Cost of one read of the process image, from Python; ``make -C plugins/wmx bench``."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from standin_build import SITE, build_all
from standin_port import port

READS = 50_000


def measure(read: Callable[[], None]) -> np.ndarray:
    """Return the time of each of ``READS`` calls, in us."""
    costs_us = np.empty(READS)
    for index in range(READS):
        start_ns = time.perf_counter_ns()
        read()
        costs_us[index] = (time.perf_counter_ns() - start_ns) / 1000.0
    return costs_us


def main() -> None:
    os.environ["WMX_STANDIN_SHM"] = f"wmx-bench-{os.getpid()}"
    build_all()
    sys.path.insert(0, str(SITE))
    from robotd.clock import MonotonicClock
    from robotd.descriptor import load_robot_descriptor
    from robotd.device.process_image import ProcessImage
    from robotd_wmx.axes import WmxAxes
    from robotd_wmx.connection import WmxConnection
    from robotd_wmx.io import WmxIo
    from robotd_wmx.options import WmxOptions
    from robotd_wmx.plugin import CAPABILITIES

    print(f"capabilities: {', '.join(sorted(CAPABILITIES))}")
    robot = load_robot_descriptor("cr3a")
    connection = WmxConnection(robot, WmxOptions(), MonotonicClock())
    connection.open("", "bench")
    connection.command.start_communication(5000)
    axes, image = WmxAxes(connection), ProcessImage(robot.axes)
    read_us = measure(lambda: axes.read(image))
    WmxIo(connection)  # copies both I/O images after each read
    with_io_us = measure(lambda: axes.read(image))
    connection.close()
    port("reset")
    Path("/dev/shm", os.environ["WMX_STANDIN_SHM"]).unlink()
    for name, costs_us in (("6 axes", read_us), ("6 axes and I/O", with_io_us)):
        p50, p99, p999 = np.percentile(costs_us, (50, 99, 99.9))
        print(f"AxisDriver.read, {name}: p50 {p50:.2f} µs, p99 {p99:.2f} µs, p99.9 {p999:.2f} µs")
    if np.median(read_us) > 10.0:
        sys.exit("the read of six axes costs more than 10 µs")


if __name__ == "__main__":
    main()
