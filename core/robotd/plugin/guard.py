"""Drivers of plugins, wrapped so that a broken one cannot hurt.

An error that is none of robotd's becomes an ``OperationError``, and a call that does not come
back a ``DeviceTimeout``; both name the plugin. What the cycle calls is not wrapped: it must
cost nothing, and the cycle and its watchdog look after it. A device that does not answer for its
state is in state UNKNOWN.
"""

from __future__ import annotations

import inspect
import threading
from abc import ABC
from collections.abc import Callable
from typing import Any, TypeVar, cast

from robotd.device.drivers import AxisDriver, DeviceDriver, FieldbusDriver, IoDriver
from robotd.device.state import EngineState
from robotd.errors import DeviceTimeout, OperationError, RobotdError
from robotd.plugin.budget import OverBudget, within

CALL_BUDGET_S = 30.0  # of calls without a time-out of their own
STATE_BUDGET_S = 0.5  # of ``state``, which must never block
GRACE_S = 2.0  # granted beyond the time-out that a call was given

_UNWRAPPED = {
    DeviceDriver: {"state", "fault"},
    AxisDriver: {"read", "stream"},
    IoDriver: {"input_bytes", "output_bytes", "read_inputs", "read_outputs"},
    FieldbusDriver: {"masters"},
}

Driver = TypeVar("Driver", bound=ABC)


def guarded(driver: Driver, contract: type[Driver], plugin: str) -> Driver:
    """``driver`` behind a guard that fulfils ``contract``; ``plugin`` is named in errors."""
    names = {name for name in dir(contract) if not name.startswith("_")}
    calls = names - _UNWRAPPED[contract]
    members: dict[str, Any] = {name: _forward(contract, name) for name in names - calls}
    members |= {name: _guard(contract, name, plugin) for name in calls}
    guard = type(f"Guarded{contract.__name__}", (contract,), members)()
    guard.__dict__["wrapped"] = driver
    for name in names - calls:
        if not isinstance(members[name], property):
            guard.__dict__[name] = getattr(driver, name)  # the cycle's way: no call in between
    if isinstance(driver, DeviceDriver):
        guard.__dict__["state"] = _Answer(driver.state)
    return cast(Driver, guard)


def unguarded(driver: Driver) -> Driver:
    """What the plugin itself made: it may know more of its driver than the contract says."""
    return cast(Driver, getattr(driver, "wrapped", driver))


class _Answer:
    """``state`` of a device; UNKNOWN while an earlier question is not answered."""

    def __init__(self, ask: Callable[[], EngineState]) -> None:
        self._ask = ask
        self._asking = threading.Lock()

    def __call__(self) -> EngineState:
        if not self._asking.acquire(timeout=STATE_BUDGET_S):
            return EngineState.UNKNOWN
        try:
            return self._ask()
        finally:
            self._asking.release()


def _forward(contract: type, name: str) -> Any:
    if isinstance(inspect.getattr_static(contract, name), property):
        return property(lambda self: getattr(self.wrapped, name))
    return lambda self, *arguments: getattr(self.wrapped, name)(*arguments)


def _guard(contract: type, name: str, plugin: str) -> Callable[..., Any]:
    signature = inspect.signature(getattr(contract, name))
    what = f"{contract.__name__}.{name}"

    def call(self: Any, *given: Any, **named: Any) -> Any:
        arguments = signature.bind(self, *given, **named).arguments
        timeout_s = arguments.get("timeout_s")
        budget_s = CALL_BUDGET_S if timeout_s is None else timeout_s + GRACE_S
        method = getattr(self.wrapped, name)
        try:
            return within(budget_s, lambda: method(*given, **named), f"robotd-{name}")
        except OverBudget:
            raise DeviceTimeout(
                f"plugin {plugin}: {what} did not return within {budget_s:g} s"
            ) from None
        except RobotdError:
            raise
        except Exception as error:
            raise OperationError(
                f"plugin {plugin}: {what} failed: {type(error).__name__}: {error}"
            ) from error

    return call
