"""``python -m tools.bench.middleware``: each workaround of robotd_ros.middleware, with and without.

Prints a table. What a test can show deterministically is in ``tests/ros/test_middleware.py``.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import Trigger
from tools.bench.process import cpu_s

from robotd_ros import services
from robotd_ros.host import RosHost
from robotd_ros.middleware import (
    EventsExecutor,
    HotPublisher,
    StampClock,
    TypeMismatchCheck,
    remove_leftovers,
    use_profiles,
)
from robotd_testing.domain import own_domain

SERVICES = 42  # as the CR3A has
CALLS = 300
STARTS = 10
FLOOD_S = 3.0
PERIODIC_S, RATE_HZ = 8.0, 500.0
NAMES = [f"joint{number}" for number in range(1, 9)]


def per_call_us(function: Callable[[], object], count: int = 20_000) -> float:
    """Microseconds per call, the best of three rounds."""
    rounds = []
    for _ in range(3):
        begin = time.perf_counter()
        for _ in range(count):
            function()
        rounds.append((time.perf_counter() - begin) / count * 1e6)
    return min(rounds)


def publishing(node: Node) -> tuple[float, float]:
    """Publish a JointState of 8 joints, stamped."""
    zeros = [0.0] * len(NAMES)
    message = JointState(name=NAMES, position=zeros, velocity=zeros, effort=zeros)
    publisher = node.create_publisher(JointState, "bench", 10)
    hot = HotPublisher(node, "bench", 10, message, ("position", "velocity", "effort"))
    values = hot.view("position")

    def patched() -> None:
        values[:] = 1.0
        hot.stamp(1)
        hot.publish()

    def plain() -> None:
        message = JointState(name=NAMES, position=zeros, velocity=zeros, effort=zeros)
        message.header.stamp.sec = 1
        publisher.publish(message)

    return per_call_us(patched), per_call_us(plain)


def stamping(node: Node) -> tuple[float, float]:
    """Read the time of a node's clock."""
    clock = node.get_clock()
    return per_call_us(StampClock(clock).now_ns), per_call_us(lambda: clock.now().nanoseconds)


def greet(_: Any, response: Any) -> Any:
    return response


@contextmanager
def server(*options: str) -> Iterator[int]:
    """Run this module as a server of ``SERVICES`` services in a process; the value is its pid."""
    with subprocess.Popen(
        [sys.executable, "-m", "tools.bench.middleware", "serve", *options],
        stdin=subprocess.PIPE,
    ) as process:
        yield process.pid
        process.kill()


def serve(options: list[str]) -> None:
    """Serve until killed.

    Options: ``single`` executor, ``profiles``, ``unlimited`` messages, a ``periodic`` topic.
    """
    if "profiles" in options:
        use_profiles()
    if "unlimited" in options:
        services.HANDLER_SHARE = 1e9
    executor = SingleThreadedExecutor if "single" in options else EventsExecutor
    with RosHost(make_executor=executor) as host:
        node = Node("server", context=host.context)
        for number in range(SERVICES):
            services.add_service(node, host, Trigger, f"s{number}", greet, blocking=False)
        services.add_subscription(node, host, Bool, "flood", lambda _: time.sleep(2e-4), 10)
        host.add_node(node)
        if "periodic" in options:
            publish_periodically(node)
        sys.stdin.read()


def publish_periodically(node: Node) -> None:
    """Publish a JointState ``RATE_HZ`` times a second until killed, as the control loop does."""
    message = JointState(name=NAMES, position=[0.0] * len(NAMES))
    hot = HotPublisher(node, "periodic", 10, message, ("position",))
    due = time.monotonic()
    while True:
        due += 1.0 / RATE_HZ
        time.sleep(max(0.0, due - time.monotonic()))
        hot.publish()


def round_trip_ms(node: Node, client: Any) -> float:
    """One call; milliseconds."""
    begin = time.perf_counter()
    done = threading.Event()
    client.call_async(Trigger.Request()).add_done_callback(lambda _: done.set())
    done.wait(30.0)
    return (time.perf_counter() - begin) * 1e3


def executors() -> tuple[float, float]:
    """Median round trip of a service, with the EventsExecutor and the SingleThreadedExecutor."""
    return tuple(_median_ms(*options) for options in ((), ("single",)))  # type: ignore[return-value]


def _median_ms(*options: str) -> float:
    with server("profiles", *options), RosHost() as host:
        node = Node("client", context=host.context)
        host.add_node(node)
        client = node.create_client(Trigger, "s0")
        client.wait_for_service(20.0)
        return statistics.median(round_trip_ms(node, client) for _ in range(CALLS))


def discovery() -> tuple[float, float]:
    """Longest time from a client's start to its first service, of ``STARTS``."""
    longest = []
    for options in (("profiles",), ()):
        with server(*options):
            time.sleep(2.0)
            longest.append(max(_found_ms() for _ in range(STARTS)))
    return longest[0], longest[1]


def _found_ms() -> float:
    begin = time.perf_counter()
    with RosHost() as host:
        node = Node("client", context=host.context)
        host.add_node(node)
        node.create_client(Trigger, "s0").wait_for_service(20.0)
        return (time.perf_counter() - begin) * 1e3


def memory() -> tuple[float, float]:
    """Resident memory of the server, MiB."""
    return _resident_mib("profiles"), _resident_mib()


def _resident_mib(*options: str) -> float:
    with server(*options) as pid, RosHost() as host:
        node = Node("client", context=host.context)
        host.add_node(node)
        node.create_client(Trigger, f"s{SERVICES - 1}").wait_for_service(20.0)
        pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def periodic() -> tuple[float, float]:
    """Processor time of a process with a topic of ``RATE_HZ`` and a reader, % of a core."""
    return _periodic_percent("profiles"), _periodic_percent()


def _periodic_percent(*options: str) -> float:
    with server("periodic", *options) as pid, RosHost() as host:
        node = Node("client", context=host.context)
        received = threading.Event()
        node.create_subscription(JointState, "periodic", lambda _: received.set(), 10, raw=True)
        host.add_node(node)
        received.wait(20.0)
        begin = cpu_s(pid)
        time.sleep(PERIODIC_S)
        return (cpu_s(pid) - begin) / PERIODIC_S * 100.0


def flood() -> tuple[float, float]:
    """Longest round trip of a service while a topic with a handler of 0.3 ms is flooded."""
    return _flooded_ms(), _flooded_ms("unlimited")


def _flooded_ms(*options: str) -> float:
    with server("profiles", *options), RosHost() as host:
        node = Node("client", context=host.context)
        host.add_node(node)
        client = node.create_client(Trigger, "s0")
        publisher = node.create_publisher(Bool, "flood", 10)
        client.wait_for_service(20.0)
        stop = threading.Event()

        def publish() -> None:
            while not stop.is_set():
                publisher.publish(Bool())

        thread = threading.Thread(target=publish)
        thread.start()
        end = time.monotonic() + FLOOD_S
        times = []
        while time.monotonic() < end:
            times.append(round_trip_ms(node, client))
        stop.set()
        thread.join()
        return max(times)


@click.command()
def main() -> None:
    """Measure everything on a domain of its own; a few minutes."""
    rows: list[tuple[str, str, float, float]] = []
    with own_domain() as domain:
        os.environ |= {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        with RosHost() as host:
            node = rclpy.create_node("bench", context=host.context)
            rows.append(("cdr.py: publish", "us", *publishing(node)))
            rows.append(("stamp_clock.py: read", "us", *stamping(node)))
            subscription = node.create_subscription(Bool, "any", lambda _: None, 1)
            check = TypeMismatchCheck(node, subscription, "std_msgs/msg/Bool", "").check
            rows.append(("type_mismatch.py: look", "us", per_call_us(check, 1000), 0.0))
            rows.append(("shared_memory.py: search", "us", per_call_us(remove_leftovers, 50), 0.0))
            node.destroy_node()
        rows.append(("executor.py: round trip, median", "ms", *executors()))
        rows.append(("fastdds_profiles.py: first service", "ms", *discovery()))
        rows.append(("fastdds_profiles.py: memory", "MiB", *memory()))
        rows.append(("fastdds_profiles.py: 500 Hz", "%", *periodic()))
        rows.append(("rate_limit.py: round trip, worst", "ms", *flood()))
    print(f"{'':36} {'with':>10} {'without':>10}   load {os.getloadavg()[0]:.1f}")
    for name, unit, with_it, without in rows:
        print(f"{name:36} {with_it:10.2f} {without:10.2f} {unit}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["serve"]:
        serve(sys.argv[2:])
    else:
        main()
