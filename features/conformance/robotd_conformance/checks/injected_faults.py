"""Faults that a check injects, which are undone after it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import pytest

from robotd.api import FaultInjector, RobotdError, Unsupported

UNDONE_BY: dict[str, tuple[str, int, tuple[Any, ...]]] = {
    "disconnect": ("reconnect", 1, ()),
    "freeze": ("freeze", 0, (False,)),
    "block": ("block", 1, (False,)),
    "set_input_bit": ("set_input_bit", 2, (False,)),
    "press_switch": ("press_switch", 2, (False,)),
    "stick_output_bit": ("stick_output_bit", 2, (None,)),
}
"""Method of a fault injector → the one that undoes it, its leading arguments, and the last."""


class InjectedFaults:
    """Fault injector that notes its faults, and whose unsupported calls skip the check.

    Args:
        injector: of the backend.
        backend: its name.
    """

    def __init__(self, injector: FaultInjector, backend: str) -> None:
        self._injector, self._backend = injector, backend
        self._undoing: dict[tuple[Any, ...], tuple[Any, ...]] = {}

    def __getattr__(self, name: str) -> Callable[..., Any]:
        method = getattr(self._injector, name)

        def call(*arguments: Any) -> Any:
            try:
                result = method(*arguments)
            except Unsupported as error:
                pytest.skip(str(Unsupported(error.feature, self._backend)))
            if name in UNDONE_BY:
                undo, count, last = UNDONE_BY[name]
                self._undoing[undo, *arguments[:count]] = last
            return result

        return call

    def undo(self) -> None:
        """Put plugs back, let values arrive, free axes and outputs, whatever a check left."""
        for (undo, *arguments), last in self._undoing.items():
            with suppress(RobotdError):
                getattr(self._injector, undo)(*arguments, *last)
        self._undoing.clear()
