"""Costs of the parts of a period, in a robot of this process.

``python -m tools.bench.costs SECONDS`` prints it as JSON. A timer around a call adds about 0.2 µs
to it and to all that contain it. Between two periods the caches and the processor's clock go cold,
and that is a part of the cost: ``in a tight loop`` shows what ``read`` takes without it.
"""

from __future__ import annotations

import json
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from typing import Any

import numpy as np

from robotd.device.process_image import ProcessImage
from robotd.log import LogFormat, configure_logging
from robotd.motion import TrajectoryRequest
from robotd.robot import Robot, build_robot
from robotd_ros.host import RosHost
from robotd_ros.middleware.cdr import HotPublisher
from robotd_ros.node_factory import make_node
from robotd_ros.plugin import BUILT_IN

TIGHT_LOOP = 2000  # reads

Times = defaultdict[str, list[int]]


def timed(times: Times, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
    now = time.perf_counter_ns

    def call(*arguments: Any) -> Any:
        start_ns = now()
        try:
            return function(*arguments)
        finally:
            times[name].append(now() - start_ns)

    return call


def instrument(robot: Robot, times: Times) -> None:
    """Put timers into the cycle of ``robot``, which has its nodes and has not started."""
    control_loop: Any = robot.control_loop
    control_loop.step = timed(times, "period", control_loop.step)
    control_loop._driver.read = timed(times, "read", control_loop._driver.read)
    control_loop._driver.stream = timed(times, "stream", control_loop._driver.stream)
    control_loop._mixer.advance = timed(times, "advance (with stream)", control_loop._mixer.advance)
    control_loop._connection.update_ready = timed(
        times, "update_ready", control_loop._connection.update_ready
    )
    for periodic in (*control_loop._tasks._first, *control_loop._tasks._others):
        periodic.task = timed(times, f"task {periodic.name}", periodic.task)
    plain = HotPublisher.publish

    def publish(self: Any) -> None:
        start_ns = time.perf_counter_ns()
        plain(self)
        times[f"publish {self._publisher.topic}"].append(time.perf_counter_ns() - start_ns)

    HotPublisher.publish = publish  # type: ignore[method-assign]


def costs(times: Times, periods: int) -> dict[str, dict[str, float]]:
    """By part: median and 99th percentile of a call, and the mean share of a period."""
    result = {}
    for name, samples in sorted(times.items(), key=lambda item: -sum(item[1])):
        p50, p99 = np.percentile(samples, (50, 99)) / 1000.0
        share = sum(samples) / 1000.0 / periods
        result[name] = {"p50_us": p50, "p99_us": p99, "mean_us_per_period": share}
    return result


def tight_loop(read: Callable[[ProcessImage], None], image: ProcessImage) -> Times:
    """``read`` again and again, into an image of its own, beside the cycle."""
    times: Times = defaultdict(list)
    call = timed(times, "read", read)
    for _ in range(TIGHT_LOOP):
        call(image)
    return times


def swing(robot: Robot, until: float) -> None:
    while time.monotonic() < until:
        for target in (0.5, 0.0):
            joints = robot.joint_names
            request = TrajectoryRequest.from_rows(joints, [1.0], [[target] * len(joints)])
            with robot.follower.follow(request) as execution:
                execution.wait(5.0)


def main(seconds: float) -> None:
    configure_logging("warning", LogFormat.CONSOLE)
    times: Times = defaultdict(list)
    result = {}
    robot = build_robot("cr3a", "sim")
    with RosHost() as host:
        for name in robot.descriptor.nodes:
            host.add_node(make_node(name, BUILT_IN[name], robot, host))
        plain_read = robot.control_loop._driver.read
        instrument(robot, times)
        robot.start()
        try:
            for phase, run in (("at rest", time.sleep), ("moving", None)):
                time.sleep(0.5)
                times.clear()
                first = robot.control_loop.stats.cycles
                if run:
                    run(seconds)
                else:
                    swing(robot, time.monotonic() + seconds)
                result[phase] = costs(times, robot.control_loop.stats.cycles - first)
            hot = tight_loop(plain_read, ProcessImage(robot.descriptor.axes))
            result["in a tight loop"] = costs(hot, TIGHT_LOOP)
        finally:
            robot.shutdown()
    print(json.dumps(result))


if __name__ == "__main__":
    main(float(sys.argv[1]))
