"""Lifetime of rclpy in a process: context, executor thread and workers."""

from __future__ import annotations

import concurrent.futures
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from typing import Any, NamedTuple, Self

import rclpy
from rclpy.context import Context
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from robotd.control.loop.watchdog import Watchdog, place_of
from robotd.errors import NotReady, OperationError
from robotd.events import sent_by
from robotd.log import get_logger
from robotd_ros.failed_requests import answer_always
from robotd_ros.middleware import (
    EventsExecutor,
    add_node,
    destroy_node,
    log_file_arguments,
    spin_once,
    wake,
)
from robotd_ros.request_log import RequestLog
from robotd_ros.senders import Senders

log = get_logger("ros")

_HANG_S = 2.0  # handlers in the executor thread read memory or hand on a command
_PENDING_LIMIT = 64


# rcl writes what a client of this service asks for to standard error, as it is and every time.
_OWN_ARGS = ("--ros-args", "-p", "start_type_description_service:=false", "--")


RejectionListener = Callable[[str, Sequence[int], str], None]


class RosHost:
    """ROS side of a process: ``with RosHost(args) as host:``.

    Threads: ``robotd-ros`` runs every callback, the others what is submitted. Signal
    handlers are left alone; their owner calls ``close``.

    Args:
        args: command line of the process, from ``--ros-args`` on or whole.
        domain_id: ROS domain; None takes ``ROS_DOMAIN_ID``.
        workers: threads for ordinary calls; each motion and each urgent call has its own.
        make_executor: called with ``context=``; any rclpy executor.
        close_timeout_s: how long ``close`` waits for what is still running.

    Attributes:
        args: as given.
        yield_to_control_loop: called in the executor thread before each callback; may wait 1 ms.
        senders: names of clients; None: they are not looked up.
        request_log: log of rejected requests.
        on_rejection: called with topic, axes and reason of a rejected command, when it is news.
        on_hang: called when a handler there does not return, once for each, and when the thread
            ends because the context was shut down; with the reason.
    """

    def __init__(
        self,
        args: Sequence[str] = (),
        *,
        domain_id: int | None = None,
        workers: int = 6,
        make_executor: Callable[..., Executor] = EventsExecutor,
        close_timeout_s: float = 5.0,
    ) -> None:
        self.yield_to_control_loop: Callable[[], None] = lambda: None
        self.on_hang: Callable[[str], None] = lambda reason: None
        self.on_rejection: RejectionListener = lambda topic, axes, reason: None
        self.senders: Senders | None = None
        self.request_log = RequestLog()
        self._handling_ns = 0
        self._watchdog = Watchdog(
            self._age_ns, self._place, _HANG_S, self._hang, who="ROS", piece="a handler"
        )
        self.args = list(args)
        self._domain_id = domain_id
        self._make_executor = make_executor
        self._close_timeout_s = close_timeout_s
        self._context = Context()
        self._running: _Running | None = None
        self._nodes: list[Node] = []
        self._stopping = threading.Event()
        # A thread of a pool starts with a call that finds none idle, so these cost nothing yet.
        self._workers = _Pool("robotd-worker", workers)
        # A goal waits for no other one, and a hard stop for no gentle one: both last until rest.
        self._motions = _Pool("robotd-motion", _PENDING_LIMIT)
        self._urgent = _Pool("robotd-urgent", _PENDING_LIMIT)
        self._lock = threading.Lock()  # of the calls of the pools

    @property
    def context(self) -> Context:
        """Context for ``create_node(name, context=host.context)``; initialized by ``start``."""
        return self._context

    def start(self) -> None:
        """Initialize rclpy and start the executor thread. Once per host.

        Raises OperationError: the ROS arguments are wrong or the middleware does not start.
        """
        without_files, reason = log_file_arguments()
        if reason:
            log.warning("ROS keeps no log files", reason=reason)
        try:
            # Always our own context: signal handlers stay with the process, and a test may
            # have two hosts.
            rclpy.init(
                args=[*_OWN_ARGS, *without_files, *self.args],
                context=self._context,
                domain_id=self._domain_id,
                signal_handler_options=SignalHandlerOptions.NO,
            )
        except Exception as error:
            raise OperationError(f"ROS does not start: {error}") from error
        executor = self._make_executor(context=self._context)
        thread = threading.Thread(
            target=self._spin, args=(executor,), name="robotd-ros", daemon=True
        )
        self._running = _Running(executor, thread)
        thread.start()
        self._watchdog.start()

    def add_node(self, node: Node) -> None:
        """Serve ``node`` until ``close``, which destroys it. Any thread.

        Its services, also the parameters', answer from now on where their callback raises.

        Raises NotReady: the host was not started or is closed.
        """
        if self._running is None:
            raise NotReady("ROS is not running")
        answer_always(node, self.request_log)
        add_node(self._running.executor, node)
        self._nodes.append(node)

    def sent_by_request(self, header: Any) -> AbstractContextManager[None]:
        """Note the sender of a request with every event of the block. Any thread.

        Args:
            header: of the request, from rclpy; None: of this process.
        """
        known = self.senders is not None and header is not None
        return sent_by(self.senders.of_request(header) if known and self.senders else "")

    def sent_by_topic(self, topic: str) -> AbstractContextManager[None]:
        """Note the publishers of ``topic`` with every event of the block. Any thread."""
        return sent_by(self.senders.of_topic(topic) if self.senders else "")

    @contextmanager
    def callback_guard(self) -> Iterator[None]:
        """Guard a handler in the executor thread, which delays all others until it returns."""
        self.yield_to_control_loop()
        self._handling_ns = time.monotonic_ns()
        try:
            yield
        finally:
            self._handling_ns = 0

    def submit(
        self,
        function: Callable[..., Any],
        *args: Any,
        urgent: bool = False,
        until_rest: bool = False,
    ) -> None:
        """Run ``function(*args)`` in a worker; what it raises is logged. Any thread.

        Args:
            function: may block.
            args: its arguments.
            urgent: never waits behind other calls; for stopping, not for moving.
            until_rest: returns when a motion has ended; no other call waits behind it, and it
                behind none.

        Raises:
            NotReady: the host is closed.
            OperationError: too many calls are waiting already.
        """
        pool = self._urgent if urgent else self._motions if until_rest else self._workers
        name = getattr(function, "__name__", "?")

        def ended(call: concurrent.futures.Future[None]) -> None:
            with self._lock:
                pool.pending.discard(call)
            if not call.cancelled() and (error := call.exception()) is not None:
                log.error("a call in a worker raised", function=name, exc_info=error)

        with self._lock:
            if len(pool.pending) >= _PENDING_LIMIT:
                raise OperationError(f"{pool.name}: {_PENDING_LIMIT} calls are waiting already")
            try:
                call = pool.executor.submit(function, *args)
            except RuntimeError as error:
                raise NotReady("ROS is not running") from error
            pool.pending.add(call)
        call.add_done_callback(ended)

    def close(self) -> None:
        """End callbacks, calls, nodes and ROS, in this order; a second call does nothing.

        Callbacks end first, then running calls may answer, both within ``close_timeout_s``, then
        the nodes go, then the executor, then rclpy; none of them where a handler does not return.
        Any thread but the executor's and the workers'.
        """
        running, self._running = self._running, None
        if running is None:
            return
        deadline = time.monotonic() + self._close_timeout_s
        self._watchdog.stop()
        self._stopping.set()
        wake(running.executor)
        running.thread.join(self._close_timeout_s)
        if running.thread.is_alive():
            log.error(
                "a ROS handler hangs; its thread is abandoned", place=place_of(running.thread)
            )
            return
        for pool in (self._urgent, self._workers, self._motions):
            # Waiting calls are canceled, running ones abandoned when they take too long.
            pool.executor.shutdown(wait=False, cancel_futures=True)
            with self._lock:
                pending = set(pool.pending)
            _, hanging = concurrent.futures.wait(pending, max(0.0, deadline - time.monotonic()))
            if hanging:
                log.error("calls still run at shut-down", pool=pool.name, count=len(hanging))
            else:
                pool.executor.shutdown(wait=True)
        for node in self._nodes:
            destroy_node(node)
        self._nodes.clear()
        running.executor.shutdown()
        self._context.try_shutdown()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _age_ns(self) -> int:
        began_ns = self._handling_ns
        return time.monotonic_ns() - began_ns if began_ns else 0

    def _place(self) -> str:
        running = self._running
        return place_of(running.thread) if running else ""

    def _hang(self, reason: str) -> None:
        self.on_hang(reason)

    def _spin(self, executor: Executor) -> None:
        while not self._stopping.is_set():
            try:
                spin_once(executor)
            except ExternalShutdownException:
                reason = "the ROS context was shut down from outside robotd"
                log.error(reason)
                self.on_hang(reason)
                return
            except Exception:
                # One broken callback must not stop the forty others.
                log.exception("a ROS callback raised")


class _Running(NamedTuple):
    executor: Executor
    thread: threading.Thread


class _Pool:
    """Threads, and the calls that have not ended."""

    def __init__(self, name: str, threads: int) -> None:
        self.name = name
        self.executor = concurrent.futures.ThreadPoolExecutor(threads, thread_name_prefix=name)
        self.pending: set[concurrent.futures.Future[None]] = set()
