"""Clean-ups: each step is tried, and none hides the first error."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from robotd.errors import RobotdError
from robotd.log import get_logger

log = get_logger("clean-up")


def run_all(*steps: Callable[[], object]) -> None:
    """Run all steps in order, whatever each raises; raise the first error, log the others."""
    first: BaseException | None = None
    for step in steps:
        try:
            step()
        except BaseException as error:  # noqa: BLE001 - KeyboardInterrupt must not end a clean-up
            if first is None:
                first = error
            else:
                _log_failure(error)
    if first is not None:
        raise first


@contextmanager
def finally_run(step: Callable[[], object]) -> Iterator[None]:
    """Run ``step`` after the block; where both raise, log the error of ``step``."""
    try:
        yield
    except BaseException:
        try:
            step()
        except Exception as error:  # noqa: BLE001 - the first one is raised
            _log_failure(error)
        raise
    step()


def _log_failure(error: BaseException) -> None:
    if isinstance(error, RobotdError):
        log.error("a clean-up failed, too", reason=str(error))
    else:
        log.error("a clean-up failed, too", exc_info=error)
