"""Faults that a device cannot inject are answered by a reason."""

from __future__ import annotations

import inspect

import pytest

from robotd.device.fault_injector import FaultInjector
from robotd.errors import Unsupported

NAMES = [
    name
    for name, _ in inspect.getmembers(FaultInjector, inspect.isfunction)
    if not name.startswith("_")
]


@pytest.mark.parametrize("name", NAMES)
def test_what_is_not_overridden_is_not_supported(name: str) -> None:
    method = getattr(FaultInjector(), name)
    arguments = [0] * len(inspect.signature(method).parameters)
    with pytest.raises(Unsupported, match=name):
        method(*arguments)
