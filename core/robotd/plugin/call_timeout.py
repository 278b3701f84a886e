"""Run a call with a time limit, in a thread that is abandoned on time-out."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from typing import TypeVar

from robotd.realtime import is_control_loop

Result = TypeVar("Result")


class CallTimeout(Exception):
    """The call has not returned in time; its thread is left to itself."""


def call_with_timeout(budget_s: float, call: Callable[[], Result], name: str) -> Result:
    """The result of ``call``, or what it raised. Any thread; costs about 0.1 ms.

    A call that never returns keeps its thread, a daemon called ``name``: Python cannot end it.
    In the control loop, which starts and waits for no thread, and while the interpreter ends, when
    none starts any more, the call runs in this thread, unlimited.

    Raises:
        CallTimeout: after ``budget_s``.
    """
    if is_control_loop() or sys.is_finalizing():
        return call()
    results: list[Result] = []
    errors: list[BaseException] = []

    def run() -> None:
        try:
            results.append(call())
        except BaseException as error:  # noqa: BLE001 - SystemExit too belongs to the caller
            errors.append(error)

    thread = threading.Thread(target=run, name=name, daemon=True)
    thread.start()
    thread.join(budget_s)
    if thread.is_alive():
        raise CallTimeout
    if errors:
        raise errors[0]
    return results[0]
