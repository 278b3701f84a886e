"""Time limits of calls: in a thread that is abandoned on time-out, or by a signal."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

from robotd.realtime import is_control_loop

Result = TypeVar("Result")
Answer = tuple[Any, BaseException | None]

IDLE_THREAD_END_S = 1.0  # for an idle thread to end
IDLE_NAME = "robotd-call"
SLICES = 20  # of a time limit, in which it is awaited
PATIENCE = 5  # times its limit, with a call that waits for a processor


class CallTimeout(Exception):
    """The call has not returned in time; its thread is left to itself.

    ``note``: for error texts: how long it has waited for a processor; "" where that is not the
    reason.
    """

    def __init__(self, note: str = "") -> None:
        super().__init__(note)
        self.note = note


class Overdue(BaseException):
    """Raised by ``interrupted_after`` where its block is; no ``except Exception`` swallows it."""


class _CallThread(threading.Thread):
    """Runs one call after the other.

    A thread that hangs is not among the idle ones until its call returns.
    """

    idle: list[_CallThread] = []  # noqa: RUF012 - of the process; appended and popped atomically

    def __init__(self) -> None:
        super().__init__(name=IDLE_NAME, daemon=True)
        self.calls: SimpleQueue[Callable[[], None] | None] = SimpleQueue()

    def run(self) -> None:
        while (call := self.calls.get()) is not None:
            call()
            del call  # an idle thread keeps no driver alive


# A forked process has none of the threads: a call that waited for one would time out.
os.register_at_fork(after_in_child=_CallThread.idle.clear)


def call_with_timeout(budget_s: float, call: Callable[[], Result], name: str) -> Result:
    """Return the result of ``call``, or raise its error. Any thread; costs about 0.03 ms.

    It runs in an idle thread, called ``name`` meanwhile, or in a new one where there is none. A
    call that never returns keeps its thread, a daemon: Python cannot end it.
    In the control loop, which starts and waits for no thread, and while the interpreter ends, when
    none starts any more, the call runs in this thread, unlimited.

    The limit is what the call has had of the computer: while its thread waits for a processor, or
    the whole process is suspended, no time passes, up to ``PATIENCE`` times the limit.

    Raises CallTimeout: after ``budget_s``.
    """
    if is_control_loop() or sys.is_finalizing():
        return call()
    try:
        thread = _CallThread.idle.pop()
    except IndexError:
        thread = _CallThread()
        thread.start()
    answers: SimpleQueue[Answer] = SimpleQueue()

    def run() -> None:
        thread.name = name
        answer: Answer
        try:
            answer = call(), None
        except BaseException as error:  # noqa: BLE001 - SystemExit too belongs to the caller
            answer = None, error
        thread.name = IDLE_NAME
        # Idle before it answers: the next call of the same caller finds this thread.
        _CallThread.idle.append(thread)
        answers.put(answer)

    thread.calls.put(run)
    result, error = _await(answers, thread.native_id or 0, budget_s)
    if error is not None:
        raise error
    return result  # type: ignore[no-any-return]


def _await(answers: SimpleQueue[Answer], thread: int, budget_s: float) -> Answer:
    """Return the answer of ``thread``; raise CallTimeout after ``budget_s``.

    Time in which the thread waits for a processor does not count, up to ``PATIENCE`` budgets. It is
    awaited in slices, so that a pause of the whole process counts as one of them.
    """
    slice_s, began_s = budget_s / SLICES, time.monotonic()
    counted_s = waited_s = 0.0
    queued_s: float | None = None  # read after the first slice: most calls cost nothing
    while counted_s - waited_s < budget_s * (1.0 - 0.5 / SLICES):
        try:
            return answers.get(timeout=slice_s)
        except Empty:
            now_s = queue_time_s(thread)
            queued_s = now_s if queued_s is None else queued_s
            counted_s, waited_s = counted_s + slice_s, now_s - queued_s
        if counted_s > PATIENCE * budget_s:
            passed_s, had_s = time.monotonic() - began_s, max(counted_s - waited_s, 0.0)
            note = f": in {passed_s:.3g} s it got {had_s:.2g} s of the computer, which is too busy"
            raise CallTimeout(note)
    raise CallTimeout


@contextmanager
def interrupted_after(limit_s: float) -> Iterator[None]:
    """Raise Overdue in the block after ``limit_s`` of the computer's time, and again after as long.

    By SIGALRM, for code that belongs to the main thread; in another one there is no limit. It ends
    loops and waits of Python, and no function in C that goes on after a signal.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    thread, began_s = threading.get_native_id(), time.monotonic()
    queued_s = queue_time_s(thread)

    def expire(*_: object) -> None:
        passed_s = time.monotonic() - began_s
        left_s = limit_s - (passed_s - (queue_time_s(thread) - queued_s))
        if left_s > limit_s / SLICES and passed_s < PATIENCE * limit_s:
            signal.setitimer(signal.ITIMER_REAL, left_s, limit_s)
            return
        raise Overdue(f"not done within {limit_s:g} s")

    before = signal.signal(signal.SIGALRM, expire)
    timer = signal.setitimer(signal.ITIMER_REAL, limit_s, limit_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, *timer)
        if signal.getsignal(signal.SIGALRM) is expire:  # the block has not set its own
            signal.signal(signal.SIGALRM, before)


def queue_time_s(thread: int) -> float:
    """Return how long a thread has waited for a processor so far; 0 where that is not counted."""
    try:
        text = Path(f"/proc/self/task/{thread}/schedstat").read_text(encoding="ascii")
        return int(text.split()[1]) * 1e-9
    except (OSError, IndexError, ValueError):
        return 0.0


def end_idle_threads() -> None:
    """End the threads that no call needs now, and wait for them."""
    with suppress(IndexError):  # another thread may take the last one
        while True:
            thread = _CallThread.idle.pop()
            thread.calls.put(None)
            thread.join(IDLE_THREAD_END_S)
