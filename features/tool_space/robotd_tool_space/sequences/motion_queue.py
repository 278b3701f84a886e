"""Queue of segments that are executed while further ones are appended."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import Self

from robotd.api.robots import Outcome
from robotd_tool_space.paths.segments import SequenceStep
from robotd_tool_space.sequences.sequence_run import SequenceRun, require_success


class MotionQueue:
    """Segments that are executed one after the other, from the first one on. Any worker thread.

    As a context it waits for the end of the motion, and stops it where its block fails.

    Args:
        begin: plans steps from where the tool rests, and returns their execution.
    """

    def __init__(self, begin: Callable[[Sequence[SequenceStep]], SequenceRun]) -> None:
        self._begin, self._lock = begin, threading.Lock()
        self._pool = ThreadPoolExecutor(1, "robotd-queue")
        self._run: SequenceRun | None = None
        self._result: Future[tuple[Outcome, str]] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, _: BaseException | None, __: TracebackType | None
    ) -> None:
        try:
            if kind is not None and self._run is not None:
                self._run.cancel()
            elif kind is None:
                self.wait()
        finally:
            self._pool.shutdown()

    def append(self, *steps: SequenceStep) -> bool:
        """Plan and check segments whole, and append them; poses are in the chosen work frame.

        Returns True where they join the motion under way without a stop; False where the tool rests
        before them, because there is none or they come too late: it slows down for its end already.

        Raises Unreachable, InvalidArgument, TrajectoryRejected: with the segment, nothing is
        appended; OperationError: the motion before ended early; NotReady: motion is stopped.
        """
        with self._lock:
            run, result = self._run, self._result
            if run is not None and run.accepts:
                return run.append(steps)
            if result is not None:
                require_success(*result.result())
            self._run = self._begin(steps)
            self._result = self._pool.submit(self._run.run)
            return False

    def wait(self) -> None:
        """Wait until the last segment has ended. Raises OperationError: it ended elsewhere."""
        if (result := self._result) is not None:
            require_success(*result.result())
