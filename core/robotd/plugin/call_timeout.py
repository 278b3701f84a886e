"""Run a call with a time limit, in a thread that is abandoned on time-out."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

from robotd.realtime import is_control_loop

Result = TypeVar("Result")

IDLE_THREAD_END_S = 1.0  # for an idle thread to end
IDLE_NAME = "robotd-call"


class CallTimeout(Exception):
    """The call has not returned in time; its thread is left to itself."""


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
    """The result of ``call``, or what it raised. Any thread; costs about 0.03 ms.

    It runs in an idle thread, called ``name`` meanwhile, or in a new one where there is none. A
    call that never returns keeps its thread, a daemon: Python cannot end it.
    In the control loop, which starts and waits for no thread, and while the interpreter ends, when
    none starts any more, the call runs in this thread, unlimited.

    Raises CallTimeout: after ``budget_s``.
    """
    if is_control_loop() or sys.is_finalizing():
        return call()
    try:
        thread = _CallThread.idle.pop()
    except IndexError:
        thread = _CallThread()
        thread.start()
    answers: SimpleQueue[tuple[Any, BaseException | None]] = SimpleQueue()

    def run() -> None:
        thread.name = name
        answer: tuple[Any, BaseException | None]
        try:
            answer = call(), None
        except BaseException as error:  # noqa: BLE001 - SystemExit too belongs to the caller
            answer = None, error
        thread.name = IDLE_NAME
        # Idle before it answers: the next call of the same caller finds this thread.
        _CallThread.idle.append(thread)
        answers.put(answer)

    thread.calls.put(run)
    try:
        result, error = answers.get(timeout=budget_s)
    except Empty:
        raise CallTimeout from None
    if error is not None:
        raise error
    return result  # type: ignore[no-any-return]


def end_idle_threads() -> None:
    """End the threads that no call needs now, and wait for them."""
    with suppress(IndexError):  # another thread may take the last one
        while True:
            thread = _CallThread.idle.pop()
            thread.calls.put(None)
            thread.join(IDLE_THREAD_END_S)
