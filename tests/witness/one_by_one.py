"""Thread pools of robotd in simulated time: one task after the other."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from contextlib import ExitStack, contextmanager
from typing import Any, Self
from unittest.mock import patch

POOLS = ("robotd_canopen.bring_up", "robotd_canopen.forced_off")


class OneByOne:
    """Executor that runs each task in the caller's thread, before ``submit`` returns."""

    def __init__(self, *_: Any, **__: Any) -> None: ...

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None: ...

    def submit(self, task: Callable[..., Any], *arguments: Any) -> Future[Any]:
        done: Future[Any] = Future()
        try:
            done.set_result(task(*arguments))
        except Exception as error:  # noqa: BLE001 - as an executor does
            done.set_exception(error)
        return done

    def map(self, task: Callable[..., Any], *arguments: Iterable[Any]) -> Iterator[Any]:
        futures = [self.submit(task, *words) for words in zip(*arguments, strict=False)]
        return (future.result() for future in futures)


@contextmanager
def one_by_one() -> Iterator[None]:
    """Run what robotd does for several drives at once in one order."""
    with ExitStack() as patches:
        for module in POOLS:
            patches.enter_context(patch(f"{module}.ThreadPoolExecutor", OneByOne))
        yield
