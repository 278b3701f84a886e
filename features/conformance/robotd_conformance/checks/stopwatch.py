"""Duration of calls, measured on a computer that may be busy."""

from __future__ import annotations

import resource
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

SCHEDULING = Path("/proc/thread-self/schedstat")  # time on a processor, and in its queue, ns


@contextmanager
def timed(durations_s: list[float]) -> Iterator[None]:
    """Append how long the block takes, for its thread, without the time that others had.

    That is the time in the queue of a processor. Where the system does not count it, and the
    thread was interrupted, only the time spent computing counts.
    """
    preempted, queued_s = _preemptions(), _queued_s()
    computing_s, began_s = time.thread_time(), time.perf_counter()
    try:
        yield
    finally:
        took_s, computed_s = time.perf_counter() - began_s, time.thread_time() - computing_s
        now_s = _queued_s()
        if queued_s is not None and now_s is not None:
            durations_s.append(max(computed_s, took_s - (now_s - queued_s)))
        else:
            durations_s.append(took_s if _preemptions() == preempted else computed_s)


def _queued_s() -> float | None:
    """Return the time that this thread has waited for a processor; None: not counted."""
    try:
        return int(SCHEDULING.read_text(encoding="ascii").split()[1]) * 1e-9
    except (OSError, IndexError):
        return None


def _preemptions() -> int:
    """Return the number of involuntary context switches of this thread."""
    return resource.getrusage(resource.RUSAGE_THREAD).ru_nivcsw
