"""Fault isolation for plugin drivers: exceptions and hangs become robotd errors.

A foreign exception becomes an ``OperationError``, a call that does not return a
``DeviceTimeout``; both name the plugin. Calls of the control loop, and those that only read
memory, have no time limit, because it takes a thread: the watchdog of the control loop detects a
hang. A device whose ``state`` does not return is in state UNKNOWN; of one whose ``fault`` does
not return, that is the fault.
"""

from __future__ import annotations

import inspect
import threading
import time
from abc import ABC
from collections.abc import Callable
from typing import Any, TypeVar, cast

from robotd.device.drivers import AxisDriver, DeviceDriver, FieldbusDriver, IoDriver
from robotd.device.state import ConnectionState
from robotd.errors import DeviceTimeout, OperationError, RobotdError, Unsupported
from robotd.plugin.call_timeout import CallTimeout, call_with_timeout
from robotd.realtime import is_control_loop

CALL_BUDGET_S = 30.0  # of calls without a time-out of their own: connecting, scanning, files
COMMAND_BUDGET_S = 10.0  # the same of axes and outputs, which only have to accept a command
ANSWER_BUDGET_S = 0.5  # of ``state`` and ``fault``, which must never block
GRACE_S = 2.0  # granted beyond the time-out that a call was given

_UNTIMED = {
    DeviceDriver: {"state", "fault"},
    AxisDriver: {"read", "stream", "stream_ran_dry", "stream_torque"},
    IoDriver: {"input_bytes", "output_bytes", "read_inputs", "read_outputs"},
    FieldbusDriver: {"buses", "register_bytes"},
}

Driver = TypeVar("Driver", bound=ABC)
Answer = TypeVar("Answer")
Call = Callable[..., Any]


def isolated(driver: Driver, contract: type[Driver], plugin: str, backend: str) -> Driver:
    """Return ``driver`` behind calls whose failures become robotd errors.

    Args:
        contract: the driver class that the result fulfils; it has no other methods.
        plugin, backend: named in errors: origin of the plugin, and name of the backend.

    The plugin's own object is its attribute ``wrapped``, for debuggers and tests.
    """
    members: dict[str, Any] = {}
    for name in (name for name in dir(contract) if not name.startswith("_")):
        what = f"plugin {plugin}: {contract.__name__}.{name}"
        if isinstance(inspect.getattr_static(contract, name), property):
            members[name] = property(_named(_getter(name, driver), what, backend))
            continue
        call = getattr(driver, name)
        if name in _UNTIMED[contract]:
            members[name] = staticmethod(_named(call, what, backend))
        else:
            signature = inspect.signature(getattr(contract, name))
            accepts = contract in (AxisDriver, IoDriver)
            timed = _timed(call, signature, what, accepts)
            members[name] = staticmethod(_named(timed, what, backend))
    if isinstance(driver, DeviceDriver):
        members["state"] = staticmethod(_state(members["state"].__func__))
        members["fault"] = staticmethod(_fault(members["fault"].__func__, f"plugin {plugin}"))
    guard = type(f"Guarded{contract.__name__}", (contract,), members)()
    guard.__dict__["wrapped"] = driver
    return cast(Driver, guard)


def _named(call: Call, what: str, backend: str) -> Call:
    """``call`` with errors that name it, or the backend that does not support it."""

    def named(*arguments: Any, **keywords: Any) -> Any:
        try:
            return call(*arguments, **keywords)
        except Unsupported as error:
            if error.backend:
                raise
            raise Unsupported(error.feature, backend) from error
        except RobotdError:
            raise
        except (Exception, SystemExit) as error:
            raise OperationError(f"{what} failed: {type(error).__name__}: {error}") from error

    return named


def _timed(call: Call, signature: inspect.Signature, what: str, accepts: bool) -> Call:
    """Wrap ``call`` with a time limit; ``signature`` is that of the contract.

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


def _state(ask: Callable[[], ConnectionState]) -> Callable[[], ConnectionState]:
    """Wrap ``state`` of a device: UNKNOWN while an earlier question is not answered."""
    return _asked_once(ask, lambda answer: answer(), ConnectionState.UNKNOWN)


def _fault(ask: Callable[[], str], plugin: str) -> Callable[[], str]:
    """Wrap ``fault`` of a device: without an answer, the reason. Never raises.

    The control loop does not ask a device whose last answer to another thread was missing.
    """
    silent = f"{plugin}: DeviceDriver.fault does not return"
    hangs = False

    def limited(answer: Callable[[], str]) -> str:
        nonlocal hangs
        try:
            text = call_with_timeout(ANSWER_BUDGET_S, answer, "robotd-fault")
        except CallTimeout:
            hangs = True
            return silent
        except RobotdError as error:
            text = str(error)
        hangs = False
        return text

    asked = _asked_once(ask, limited, silent)
    return lambda: silent if hangs and is_control_loop() else asked()


def _asked_once(
    ask: Callable[[], Answer], limited: Callable[[Callable[[], Answer]], Answer], silent: Answer
) -> Callable[[], Answer]:
    """Wrap a question to a device: ``silent`` while an earlier one is not answered.

    The control loop does not wait for the answer to another thread.
    """
    asking = threading.Lock()
    asked_s = 0.0

    def answer() -> Answer:
        """In a thread that may hang for ever; it is not called again then."""
        try:
            return ask()
        finally:
            asking.release()

    def question() -> Answer:
        nonlocal asked_s
        in_loop = is_control_loop()
        if asking.acquire(timeout=0.0 if in_loop else ANSWER_BUDGET_S):
            asked_s = time.monotonic()
            return limited(answer)
        if in_loop and time.monotonic() - asked_s < ANSWER_BUDGET_S:
            return ask()  # another thread is being answered now, or hangs since a moment ago
        return silent

    return question
