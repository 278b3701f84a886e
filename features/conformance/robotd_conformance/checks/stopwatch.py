"""Duration of calls, measured on a computer that may be busy."""

from __future__ import annotations

import resource
import time
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def timed(durations_s: list[float]) -> Iterator[None]:
    """Append how long the block takes, for its thread.

    Where the computer gave the processor to others meanwhile, that is the time spent computing:
    it is not known how long the block would have waited otherwise.
    """
    preempted, computing_s, began_s = _preemptions(), time.thread_time(), time.perf_counter()
    try:
        yield
    finally:
        took_s = time.perf_counter() - began_s
        undisturbed = _preemptions() == preempted
        durations_s.append(took_s if undisturbed else time.thread_time() - computing_s)


def _preemptions() -> int:
    """Return the number of involuntary context switches of this thread."""
    return resource.getrusage(resource.RUSAGE_THREAD).ru_nivcsw
