"""Fault isolation for plugin drivers: exceptions and hangs become robotd errors.

A foreign exception becomes an ``OperationError``, a call that does not return an
``AbandonedCall``; both name the plugin. Calls of the control loop, and those that only read
memory, have no time limit, because it takes a thread: the watchdog of the control loop detects a
hang. A device whose ``state`` does not return is in state UNKNOWN; one whose ``fault`` does not
return has that as its fault. Values in the process image are not judged here: NaN is "not known",
and who reads a value decides what that means.
"""

from __future__ import annotations

import inspect
import threading
import time
from abc import ABC
from collections.abc import Callable
from functools import partial
from typing import Any, Generic, TypeVar, cast

from robotd.call_timeout import CallTimeout, call_with_timeout
from robotd.device.drivers import AxisDriver, DeviceDriver, FieldbusDriver, IoDriver
from robotd.device.passive_joints import DrivenFingers, PassiveJoints
from robotd.device.payload import PayloadDriver
from robotd.device.state import ConnectionState
from robotd.device.world import World
from robotd.device.wrench import WrenchDriver
from robotd.errors import (
    AbandonedCall,
    OperationError,
    RobotdError,
    Unsupported,
    plugin_failure,
)
from robotd.realtime import is_control_loop

CALL_BUDGET_S = 30.0  # of calls without a time-out of their own: connecting, scanning, files
COMMAND_BUDGET_S = (
    10.0  # the same of axes, outputs and fingers, which only have to accept a command
)
ANSWER_BUDGET_S = 0.5  # of ``state`` and ``fault``, which must never block
GRACE_S = 2.0  # granted beyond the time-out that a call was given

_UNTIMED = {
    DeviceDriver: {"state", "fault"},
    AxisDriver: {"read", "stream", "stream_ran_dry", "stream_torque"},
    IoDriver: {"input_bytes", "output_bytes", "read_inputs", "read_outputs"},
    FieldbusDriver: {"buses", "register_bytes"},
    PassiveJoints: {"read"},
    DrivenFingers: {"read", "stop"},
    PayloadDriver: {"payload"},
    WrenchDriver: {"read"},
    World: {"poses", "image"},  # a call with a limit has a thread of its own, a renderer one thread
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
    module = type(driver).__module__
    for name in (name for name in dir(contract) if not name.startswith("_")):
        what, attribute = f"plugin {plugin}: {contract.__name__}.{name}", getattr(contract, name)
        if isinstance(attribute, property):
            get = _guarded(lambda _, name=name: getattr(driver, name), what, module, backend)
            members[name] = property(get)
            continue
        signature = None if name in _UNTIMED[contract] else inspect.signature(attribute)
        own_s = (
            COMMAND_BUDGET_S if contract in (AxisDriver, IoDriver, DrivenFingers) else CALL_BUDGET_S
        )
        call = _guarded(getattr(driver, name), what, module, backend, signature, own_s)
        members[name] = staticmethod(call)
    if isinstance(driver, DeviceDriver):
        ask_state, ask_fault = members["state"].__func__, members["fault"].__func__
        members["state"] = staticmethod(_Question(ask_state, ConnectionState.UNKNOWN).ask)
        silent = f"plugin {plugin}: DeviceDriver.fault does not return"
        members["fault"] = staticmethod(_FaultQuestion(ask_fault, silent).ask)
    guard = type(f"Guarded{contract.__name__}", (contract,), members)()
    guard.__dict__["wrapped"] = driver
    return cast(Driver, guard)


def _guarded(
    call: Call,
    what: str,
    module: str,
    backend: str,
    signature: inspect.Signature | None = None,
    own_s: float = 0,
) -> Call:
    """Wrap ``call``: its errors name ``what``, or the backend that does not support it.

    Args:
        what, module: plugin and method, and the module of the driver, for errors.
        signature: of the contract's method, which has a time limit; None: it has none.
        own_s: the limit of a method without a ``timeout_s``.
    """

    def guarded(*given: Any, **named: Any) -> Any:
        budget_s = own_s
        try:
            if signature is None:
                return call(*given, **named)
            timeout_s = signature.bind(None, *given, **named).arguments.get("timeout_s")
            if timeout_s is not None:
                budget_s = timeout_s + GRACE_S
            name = f"robotd-{call.__name__}"
            return call_with_timeout(budget_s, partial(call, *given, **named), name)
        except CallTimeout as late:
            text = f"{what} did not return within {budget_s:g} s{late.note}"
            raise AbandonedCall(text) from None
        except Unsupported as error:
            if error.backend:
                raise
            raise Unsupported(error.feature, backend) from error
        except RobotdError:
            raise
        except (Exception, SystemExit) as error:
            raise OperationError(f"{what} failed: {plugin_failure(error, module)}") from error

    return guarded


class _Question(Generic[Answer]):
    """A question to a device: ``silent`` while an earlier one is not answered. Any thread.

    The control loop does not wait for the answer to another thread.
    """

    def __init__(self, call: Callable[[], Answer], silent: Answer) -> None:
        self._call, self._silent = call, silent
        self._asking = threading.Lock()
        self._asked_s = 0.0

    def ask(self) -> Answer:
        in_loop = is_control_loop()
        if self._asking.acquire(timeout=0.0 if in_loop else ANSWER_BUDGET_S):
            self._asked_s = time.monotonic()
            return self._await_answer()
        if in_loop and time.monotonic() - self._asked_s < ANSWER_BUDGET_S:
            return self._call()  # another thread is being answered now, or hangs since a moment ago
        return self._silent

    def _await_answer(self) -> Answer:
        """Make the call, in a thread that may hang for ever and is abandoned then."""
        try:
            return self._call()
        finally:
            self._asking.release()


class _FaultQuestion(_Question[str]):
    """``fault`` of a device: without an answer, the reason. Never raises.

    The control loop does not ask a device whose last answer to another thread was missing, and the
    other threads do not wait again for an answer that is still missing: the rejection of each
    command has the fault.
    """

    _hangs = False

    def ask(self) -> str:
        hangs = self._hangs and (is_control_loop() or self._asking.locked())
        return self._silent if hangs else super().ask()

    def _await_answer(self) -> str:
        try:
            text = call_with_timeout(ANSWER_BUDGET_S, super()._await_answer, "robotd-fault")
        except CallTimeout:
            self._hangs = True
            return self._silent
        except RobotdError as error:
            text = str(error)
        self._hangs = False
        return text
