"""Serving of a robot on ROS 2 until a signal: nodes first, then the robot."""

from __future__ import annotations

import ctypes
import gc
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from types import FrameType
from typing import TYPE_CHECKING, Any, NoReturn

from robotd.cli.exit_codes import ServosNotOff
from robotd.cli.start_summary import ServeReport
from robotd.errors import RobotdError
from robotd.log import get_logger
from robotd.plugin.registry import NodeInfo, NodeRegistry
from robotd.robot import Robot
from robotd.stop_signals import stop_signals
from robotd_ros.host import RosHost
from robotd_ros.middleware import check_remapping, exit_after, remove_leftovers, use_profiles
from robotd_ros.robot_lifecycle import RobotLifecycle
from robotd_ros.run_nodes import own_nodes, report_of, run_nodes, served_nodes

if TYPE_CHECKING:
    from rclpy.node import Node


log = get_logger("serve")

START_ABORT_TIMEOUT_S = 10.0  # the longest that a start-up under way is waited for
EMERGENCY_STOP_TIMEOUT_S = 0.5  # for the quick stop of a second signal
EXIT_INTERRUPTED = 130
TEAR_DOWN_TIMEOUT_S = 8  # of all of ROS; ``RosHost.close`` waits up to 5 s for calls
M_ARENA_MAX, ARENAS = -8, 2  # malloc.h
# A supervisor that signals the process and then its group means one signal, not two.
REPEAT_S = 0.3
POLL_INTERVAL_S = 0.1


@dataclass(frozen=True)
class _Stop:
    """The process is asked to end, by a signal or a lifecycle manager."""

    cause: str


@dataclass(frozen=True)
class _StartEnded:
    """The robot is up, or ``error`` says why not."""

    error: Exception | None


@dataclass(frozen=True)
class _Ended:
    """The robot is shut down, or ``error`` is what went wrong on the way."""

    error: Exception | None


Event = _Stop | _StartEnded | _Ended


def serve(
    robot: Robot,
    node_names: Sequence[str],
    ros_args: Sequence[str] = (),
    *,
    registry: NodeRegistry | None = None,
    served: Callable[[ServeReport], None] | None = None,
    ready: Callable[[], None] | None = None,
    ended: Callable[[Exception | None], int] | None = None,
    parts: Mapping[str, Any] | None = None,
) -> int:
    """Make the nodes, start the robot, and serve until a stop signal. Main thread only.

    The first signal stops in order: motion, servos, communication, device, nodes, ROS. A second
    one, other than SIGHUP, tries a quick stop and ends the process with status 130 at once.

    Args:
        robot: not started.
        node_names: nodes to make; one that ``enables_servos`` switches them on, unless
            ``engine.enable_at_start`` forbids it.
        ros_args: from ``--ros-args`` on.
        registry: nodes that can be named; None: the built-in ones.
        served: called when the nodes are served, before the robot starts.
        ready: called when the robot has started.
        ended: called when the robot is shut down, with the error that ``serve`` is going to raise;
            returns the exit status of the process, which then ends with it after
            ``TEAR_DOWN_TIMEOUT_S`` even where the middleware hangs. None: no limit.
        parts: running features by name.

    Returns:
        0 after an orderly stop.

    Raises:
        DescriptorError, PluginError: a node or a parameter is wrong; nothing was opened.
        RobotdError: the robot did not start, and no ``wmx_engine_node`` is there to start it
            by hand; it is shut down again.
        ServosNotOff: drives have not confirmed to be off.
    """
    served_names = [*node_names, *robot.backend.nodes.nodes]
    known_nodes = served_nodes(robot, registry)
    chosen = list(known_nodes.select(served_names).values())
    own = own_nodes()
    known = {*known_nodes.nodes, *own}
    ros_args = check_remapping({*served_names, *own}, known, ros_args)
    use_profiles()
    _limit_heaps()
    if leftovers := remove_leftovers():
        log.info("segments of killed processes removed from shared memory", segments=leftovers)
    events: SimpleQueue[Event] = SimpleQueue()
    with (
        _stop_signals(events),
        RosHost(ros_args) as host,
        run_nodes(robot, node_names, host, registry, parts) as nodes,
    ):
        if served is not None:
            served(report_of(nodes))
        _run(robot, chosen, events, ready, ended, _lifecycle(nodes))
    return 0


def _run(
    robot: Robot,
    nodes: Sequence[NodeInfo],
    events: SimpleQueue[Event],
    ready: Callable[[], None] | None,
    ended: Callable[[Exception | None], int] | None,
    lifecycle: RobotLifecycle | None,
) -> None:
    """Start the robot, wait, shut it down; in threads, so that signals are handled."""
    enable = any(node.enables_servos for node in nodes)
    # After a start that failed the process goes on where something can repeat the start.
    may_repeat = robot.descriptor.engine.reconnect or any(node.keeps_failed_start for node in nodes)
    start = _in_thread("robotd-start", lambda: _begin(robot, lifecycle, enable, events))
    failure: Exception | None = None
    try:
        while not isinstance(event := _next(events), _Stop):
            if not isinstance(event, _StartEnded):
                continue
            if event.error is None:
                if ready is not None:
                    ready()
            elif may_repeat and isinstance(event.error, RobotdError):
                advice = "robotd recover"
                log.error("the robot did not start", reason=str(event.error), advice=advice)
            else:
                failure = event.error
                break
        else:
            log.info("stopping", cause=event.cause)
    finally:
        _in_thread("robotd-stop", lambda: _stop(robot, start, events))
        shut_down = _wait_until_ended(robot, events)
        error = failure or shut_down.error
        if ended is not None:
            exit_after(TEAR_DOWN_TIMEOUT_S, ended(error))
    if error is not None:
        raise error


def _next(events: SimpleQueue[Event]) -> Event:
    """The next event. Main thread.

    Python handles a signal here, but one that comes just before the wait, or to another thread,
    does not end the wait.
    """
    while True:
        with suppress(Empty):
            return events.get(timeout=POLL_INTERVAL_S)


def _begin(
    robot: Robot, lifecycle: RobotLifecycle | None, enable: bool, events: SimpleQueue[Event]
) -> None:
    if lifecycle is None:
        _start(robot, enable and robot.descriptor.engine.enable_at_start, events)
    else:  # its ``activate`` is a command
        _manage(lifecycle, enable, events)
    # What start-up made stays: a full collection over it would cost the loop 20 ms. Until now
    # there was none at all: `robotd run` has seen to that.
    gc.freeze()
    gc.enable()
    _return_free_memory()


def _start(robot: Robot, enable: bool, events: SimpleQueue[Event]) -> None:
    try:
        robot.start(enable=enable)
    except Exception as error:  # noqa: BLE001 - the main thread raises it
        events.put(_StartEnded(error))
    else:
        events.put(_StartEnded(None))


def _manage(lifecycle: RobotLifecycle, enable: bool, events: SimpleQueue[Event]) -> None:
    """Leave the start to a lifecycle manager; the first activation counts as the start."""
    activated = threading.Event()

    def on_active() -> None:
        if not activated.is_set():
            activated.set()
            events.put(_StartEnded(None))

    lifecycle.enables_servos = enable
    lifecycle.on_active = on_active
    lifecycle.on_finalized = lambda: events.put(_Stop("lifecycle manager"))
    log.info("managed: waiting for the transition configure")


def _lifecycle(nodes: Sequence[Node]) -> RobotLifecycle | None:
    """Return the lifecycle of a managed robot; None where it is not managed."""
    found = (getattr(node, "lifecycle", None) for node in nodes)
    return next((thread for thread in found if thread is not None), None)


def _stop(robot: Robot, start: threading.Thread, events: SimpleQueue[Event]) -> None:
    try:
        robot.connection.abort_start()
        start.join(START_ABORT_TIMEOUT_S)
        unconfirmed = robot.shutdown()
    except Exception as error:
        log.exception("shut-down failed")
        events.put(_Ended(error))
    else:
        events.put(_Ended(ServosNotOff(unconfirmed) if unconfirmed else None))


def _wait_until_ended(robot: Robot, events: SimpleQueue[Event]) -> _Ended:
    while not isinstance(event := _next(events), _Ended):
        if isinstance(event, _Stop):
            _exit_now(robot)
    return event


def _exit_now(robot: Robot) -> NoReturn:
    """Request a quick stop, wait ``EMERGENCY_STOP_TIMEOUT_S`` for it, and end the process."""
    log.error("second signal: quick stop, then exit without clean-up")
    axes = list(range(len(robot.axes)))
    quick_stop = _in_thread("robotd-quick-stop", lambda: robot.axes.quick_stop(axes))
    quick_stop.join(EMERGENCY_STOP_TIMEOUT_S)
    os._exit(EXIT_INTERRUPTED)


def _limit_heaps() -> None:
    """Limit glibc to two heaps: each keeps its highest use for ever.

    A parameter file of 1 MB is 8 MiB while it is read: 50 MiB when each worker has read it once.
    """
    if mallopt := getattr(ctypes.CDLL(None), "mallopt", None):  # other C libraries have none
        mallopt(M_ARENA_MAX, ARENAS)


def _return_free_memory() -> None:
    """Return freed memory to the system: 8 MiB of imports and parameters, in 1 ms."""
    if malloc_trim := getattr(ctypes.CDLL(None), "malloc_trim", None):
        malloc_trim(0)


@contextmanager
def _stop_signals(events: SimpleQueue[Event]) -> Iterator[None]:
    """Stop signals as events; ignored afterwards where one came.

    ``SimpleQueue.put`` is safe in a signal handler.
    """
    last_s = -REPEAT_S
    terminal_lost = False

    def on_signal(number: int, frame: FrameType | None) -> None:
        nonlocal last_s, terminal_lost
        is_first = last_s < 0.0
        if number == signal.SIGHUP:
            # The kernel, the shell and the session manager may send one each, and then SIGTERM:
            # only what comes after that is meant as a second signal.
            if is_first and not terminal_lost:
                events.put(_Stop("SIGHUP"))
            terminal_lost = True
            return
        now_s = time.monotonic()
        if now_s - last_s >= REPEAT_S:
            last_s = now_s
            if not (is_first and terminal_lost):
                events.put(_Stop(signal.Signals(number).name))

    before = {number: signal.signal(number, on_signal) for number in stop_signals()}
    try:
        yield
    finally:
        came = terminal_lost or last_s >= 0.0
        for number, handler in before.items():
            # After a stop the process is about to end: one more signal must not spoil its status.
            signal.signal(number, signal.SIG_IGN if came else handler)


def _in_thread(name: str, function: Callable[[], None]) -> threading.Thread:
    thread = threading.Thread(target=function, name=name, daemon=True)
    thread.start()
    return thread


__all__ = ["ServeReport", "serve"]
