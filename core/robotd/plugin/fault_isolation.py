"""Drivers of plugins, wrapped so that a broken one cannot hurt.

An error that is none of robotd's becomes an ``OperationError``, and a call that does not come
back a ``DeviceTimeout``; both name the plugin. What the cycle calls, and what only reads memory,
is not timed, for it must cost next to nothing: the cycle and its watchdog look after it. A device
that does not answer for its state is in state UNKNOWN; one that cannot say why says that.
"""

from __future__ import annotations

import inspect
import threading
from abc import ABC
from collections.abc import Callable
from typing import Any, TypeVar, cast

from robotd.device.drivers import AxisDriver, DeviceDriver, FieldbusDriver, IoDriver
from robotd.device.state import ConnectionState
from robotd.errors import DeviceTimeout, OperationError, RobotdError
from robotd.plugin.call_timeout import CallTimeout, call_with_timeout

CALL_BUDGET_S = 30.0  # of calls without a time-out of their own: connecting, scanning, files
COMMAND_BUDGET_S = 10.0  # the same of axes and outputs, which only have to accept a command
ANSWER_BUDGET_S = 0.5  # of ``state`` and ``fault``, which must never block
GRACE_S = 2.0  # granted beyond the time-out that a call was given

_UNTIMED = {
    DeviceDriver: {"state", "fault"},
    AxisDriver: {"read", "stream"},
    IoDriver: {"input_bytes", "output_bytes", "read_inputs", "read_outputs"},
    FieldbusDriver: {"masters"},
}

Driver = TypeVar("Driver", bound=ABC)
Call = Callable[..., Any]


def isolated(driver: Driver, contract: type[Driver], plugin: str) -> Driver:
    """``driver`` behind a guard that fulfils ``contract``; ``plugin`` is named in errors."""
    members: dict[str, Any] = {}
    for name in (name for name in dir(contract) if not name.startswith("_")):
        what = f"plugin {plugin}: {contract.__name__}.{name}"
        if isinstance(inspect.getattr_static(contract, name), property):
            members[name] = property(_named(_getter(name, driver), what))
            continue
        call = getattr(driver, name)
        if name in _UNTIMED[contract]:
            members[name] = staticmethod(_named(call, what))
        else:
            signature = inspect.signature(getattr(contract, name))
            accepts = contract in (AxisDriver, IoDriver)
            members[name] = staticmethod(_named(_timed(call, signature, what, accepts), what))
    if isinstance(driver, DeviceDriver):
        members["state"] = staticmethod(_State(members["state"]))
        members["fault"] = staticmethod(_Fault(members["fault"], f"plugin {plugin}"))
    guard = type(f"Guarded{contract.__name__}", (contract,), members)()
    guard.__dict__["wrapped"] = driver
    return cast(Driver, guard)


def unguarded(driver: Driver) -> Driver:
    """What the plugin itself made: it may know more of its driver than the contract says."""
    return cast(Driver, getattr(driver, "wrapped", driver))


def _named(call: Call, what: str) -> Call:
    """``call`` with errors that name it."""

    def named(*arguments: Any, **keywords: Any) -> Any:
        try:
            return call(*arguments, **keywords)
        except RobotdError:
            raise
        except (Exception, SystemExit) as error:
            raise OperationError(f"{what} failed: {type(error).__name__}: {error}") from error

    return named


def _timed(call: Call, signature: inspect.Signature, what: str, accepts: bool) -> Call:
    """``call`` that is given up when its time is over; ``signature`` is that of the contract.

    ``accepts``: it only has to accept a command.
    """

    def timed(*given: Any, **named: Any) -> Any:
        timeout_s = signature.bind(None, *given, **named).arguments.get("timeout_s")
        own_s = COMMAND_BUDGET_S if accepts else CALL_BUDGET_S
        budget_s = own_s if timeout_s is None else timeout_s + GRACE_S
        try:
            return call_with_timeout(
                budget_s, lambda: call(*given, **named), f"robotd-{call.__name__}"
            )
        except CallTimeout:
            raise DeviceTimeout(f"{what} did not return within {budget_s:g} s") from None

    return timed


def _getter(name: str, driver: object) -> Call:
    return lambda _: getattr(driver, name)


class _State:
    """``state`` of a device; UNKNOWN while an earlier question is not answered."""

    def __init__(self, ask: Callable[[], ConnectionState]) -> None:
        self._ask = ask
        self._asking = threading.Lock()

    def __call__(self) -> ConnectionState:
        if not self._asking.acquire(timeout=ANSWER_BUDGET_S):
            return ConnectionState.UNKNOWN
        try:
            return self._ask()
        finally:
            self._asking.release()


class _Fault:
    """``fault`` of a device; what is wrong with the answer where there is none. Never raises."""

    def __init__(self, ask: Callable[[], str], plugin: str) -> None:
        self._ask = ask
        self._silent = f"{plugin}: DeviceDriver.fault does not return"
        self._asking = threading.Lock()

    def __call__(self) -> str:
        if not self._asking.acquire(timeout=ANSWER_BUDGET_S):
            return self._silent
        try:
            return call_with_timeout(ANSWER_BUDGET_S, self._answer, "robotd-fault")
        except CallTimeout:
            return self._silent
        except RobotdError as error:
            return str(error)

    def _answer(self) -> str:
        """In a thread that may stay for ever: then nobody asks again."""
        try:
            return self._ask()
        finally:
            self._asking.release()
