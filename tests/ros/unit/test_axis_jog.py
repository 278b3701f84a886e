"""Dead-man jog of axes in velocity mode: the stop when messages have ended."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from types import SimpleNamespace
from typing import Any

import pytest
from tests.core.control.harness import PERIOD_S, Harness

from robotd.clock import NANOSECONDS
from robotd.errors import OperationError
from robotd_ros.nodes.axis_motion import AxisJog


class BusyHost:
    """Rejects the first call, as a host whose workers are busy; records the others."""

    def __init__(self) -> None:
        self.rejections = 1
        self.calls: list[tuple[Callable[..., Any], tuple[Any, ...], bool]] = []

    def submit(self, function: Callable[..., Any], *args: Any, urgent: bool = False) -> None:
        if self.rejections:
            self.rejections -= 1
            raise OperationError("64 calls are waiting already")
        self.calls.append((function, args, urgent))


def test_a_stop_that_no_worker_takes_is_tried_again() -> None:
    harness, host = Harness().up(), BusyHost()
    jog: Any = AxisJog(harness.robot, host, "wmx/axis/jog", 0.2)  # type: ignore[arg-type]
    jog._deadlines = {1: harness.clock.now_ns() + NANOSECONDS // 100}
    harness.run(0.1 + PERIOD_S)
    assert host.rejections == 0
    assert host.calls == [(jog._stop, ([1],), True)]
    assert jog._deadlines == {}


def test_a_stop_that_the_device_rejects_is_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    harness, errors = Harness().up(), [OperationError("no answer")]
    stopped: list[list[int]] = []

    def stop(axes: list[int]) -> None:
        if errors:
            raise errors.pop()
        stopped.append(axes)

    def submit(function: Callable[..., Any], *args: Any, urgent: bool) -> None:
        with suppress(OperationError):  # the host logs it
            function(*args)

    monkeypatch.setattr(harness.robot.axes, "stop", stop)
    host: Any = SimpleNamespace(submit=submit, on_rejection=lambda *_: None)
    jog: Any = AxisJog(harness.robot, host, "wmx/axis/jog", 0.2)
    jog._deadlines = {1: harness.clock.now_ns() + NANOSECONDS // 100}
    harness.run(0.1 + PERIOD_S)
    assert stopped == [[1]]
    assert jog._deadlines == {}
