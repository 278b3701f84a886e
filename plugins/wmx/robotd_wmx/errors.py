"""Table from the engine's error codes to robotd's errors.

The name of a code comes from the SDK that the binding was built against, the text from
``error_codes.tsv`` by that name; the numbers in the table are those of WMX 3.5 and only serve
to read logs. A code without a name keeps the SDK's own text, its number and its class.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib.resources import files
from typing import NamedTuple

from robotd.api import (
    ConnectError,
    DeviceTimeout,
    InvalidArgument,
    NotReady,
    OperationError,
    RobotdError,
)
from robotd_wmx import _native
from robotd_wmx._native import CallError

NOT_READY = frozenset({
    "APIChannelError", "AxisAmpAlarm", "BusyReceivingAnotherAPICommand", "CommNotStarted",
    "DeviceIsNotInUse", "DeviceIsNull", "EmergencyStopSignalOn", "NotIdleOrIntplState",
    "NotIdleOrPosOrJogState", "NotIdleOrVelocityState", "NotIdleState", "NotPosMode",
    "NotServoOn", "NotVelocityMode", "ServoOff", "ServoOffline", "StatusChannelError",
    "SystemIsNoRunning",
})  # fmt: skip
TIMEOUTS = frozenset({
    "APIChannelTimeOut", "CallbackFuncTimeOut", "CommNotStartedInSpecifiedTime",
    "CommNotStoppedInSpecifiedTime", "EngineNotStartedInSpecifiedTime",
    "EngineNotStoppedInSpecifiedTime", "SystemInitializationNotDone", "WaitTimeout",
})  # fmt: skip
INVALID = frozenset({
    "ArgumentOutOfRange", "AxisOutOfRange", "ChannelOutOfRange", "DimensionOutOfRange",
    "DuplicateAxis", "IDOutOfRange", "IOAddressOutOfRange", "IOSizeOutOfRange",
    "PointTimeNotIncreasing",
})  # fmt: skip
LOCKED = frozenset({"CreateDeviceLockError", "StartProcessLockError", "SetDeviceNameTimeout"})


class ErrorCode(NamedTuple):
    """One row of the table."""

    api: str
    code: int
    name: str
    text: str


@cache
def table() -> dict[tuple[str, str], ErrorCode]:
    """(class, name) → row."""
    lines = (files("robotd_wmx") / "error_codes.tsv").read_text("utf-8").splitlines()
    rows = csv.reader(lines[1:], delimiter="\t")
    return {(api, name): ErrorCode(api, int(code), name, text) for api, code, name, text in rows}


@cache
def names() -> dict[tuple[str, int], str]:
    """(class, code) → name in the SDK in use."""
    return {(api, code): name for api, code, name in _native.error_names()}


def _bases(api: str) -> tuple[str, ...]:
    """The classes whose codes a call of ``api`` returns."""
    return {
        "engine": ("engine",),
        "advanced motion": ("advanced motion", "core motion", "engine"),
    }.get(api, (api, "engine"))


def name_of(error: CallError) -> str:
    """The code's name in the SDK in use; empty when it has none."""
    return error.args[3]


def text_of(api: str, code: int, sdk_text: str = "") -> str:
    """Return the text of a code: ``wmx 297 (device locked by another process)``."""
    for base in _bases(api):
        if name := names().get((base, code)):
            row = table().get((base, name))
            return f"wmx {code} ({row.text if row else name})"
    text = "" if sdk_text in ("", "ErrorCodeNotDefined") else f", the SDK says: {sdk_text}"
    return f"wmx {code} (unknown {api} error 0x{code:X}{text})"


def translate(
    error: CallError,
    what: str,
    fallback: type[RobotdError] = OperationError,
    *,
    axis: int | None = None,
) -> RobotdError:
    """Return the error to raise instead; ``code`` is the engine's number.

    Args:
        what: the command that failed, first in the reason (``servo on``).
        fallback: its type where the code does not say more.
        axis: that it concerns; None: no single axis.
    """
    call, api, code, name, sdk_text = error.args
    kind: type[RobotdError] = fallback
    if not issubclass(fallback, ConnectError):
        for chosen, group in (
            (NotReady, NOT_READY),
            (DeviceTimeout, TIMEOUTS),
            (InvalidArgument, INVALID),
        ):
            kind = chosen if name in group else kind
    translated = kind(f"{what}: {text_of(api, code, sdk_text)} from {call}")
    translated.axis, translated.code = axis, code
    return translated


@contextmanager
def translated(
    what: str, fallback: type[RobotdError] = OperationError, *, axis: int | None = None
) -> Iterator[None]:
    """Raise robotd's errors for failed calls of the engine in this block. See ``translate``."""
    try:
        yield
    except CallError as error:
        raise translate(error, what, fallback, axis=axis) from error
