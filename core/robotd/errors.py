"""Every error that robotd raises on purpose, one type per phase::

    RobotdError
    ├── DescriptorError      a robot file is wrong: file, line, key path, what and why
    ├── RecordingError       a file is not a recording of robotd, is damaged, or does not fit
    ├── PluginError          a backend cannot be found, loaded or trusted
    ├── ConnectError         the device or one of its children does not answer while opening
    ├── OperationError       a command failed or was rejected
    │   ├── InvalidArgument  the caller's value is out of range (also a ValueError)
    │   ├── LateSetpoint     a streamed setpoint missed its due time
    │   ├── NotReady         the device is not in a state that allows the command
    │   └── Unsupported      this backend cannot do it, ever
    └── DeviceTimeout        the device did not do it in time (also a TimeoutError)
        └── AbandonedCall    a call into a plugin has not returned at all

A backend's own errors inherit one of these. Every error carries its parts: ``reason``, the
``axis`` that it concerns, and the vendor's number in ``code``. ``str`` puts them together once.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from difflib import get_close_matches
from pathlib import Path
from traceback import walk_tb
from typing import Any

MAX_FAILURE = 1000  # characters of what a plugin raised
MAX_SHOWN = 50  # problems of one file that a text lists; a hostile file can have a million
MAX_KEY = 200  # characters; names in a file have any length


class RobotdError(Exception):
    """Root of the tree. ``str(error)`` is ``joint2: servo is off``: the axis, then the reason.

    Args:
        reason: thing, value and limit, without the axis.
        axis: number of the axis that the error concerns; None: no single axis. A driver may
            leave it out in a method that commands one axis: the core fills it in.
        code: the vendor's error number, None where there is none.

    Attributes:
        reason: as given.
        axis: as given.
        code: as given.
        axis_name: name of the axis, filled in by the core; "" shows the number instead.
    """

    def __init__(
        self, reason: str = "", *, axis: int | None = None, code: int | None = None
    ) -> None:
        super().__init__(reason)
        self.reason = reason
        self.axis = axis
        self.axis_name = ""
        self.code = code

    def __str__(self) -> str:
        if self.axis is None:
            return self.reason
        return f"{self.axis_name or f'axis {self.axis}'}: {self.reason}"


class DescriptorError(RobotdError):
    """A robot descriptor or parameter file is wrong.

    Args:
        message: what is wrong, with the value and the limit.
        path: the file; None when it was never found.
        line: 1-based line in the file; None when the whole file is meant.
        key: dotted key path (``joints.2.velocity_rad_s``); None when no key is meant.
    """

    def __init__(
        self,
        message: str,
        *,
        path: Path | str | None = None,
        line: int | None = None,
        key: str | None = None,
    ) -> None:
        self.path = Path(path) if path is not None else None
        self.line = line
        self.key = key
        where = "" if path is None else f"{path}:" if line is None else f"{path}:{line}:"
        shown = f"{key[:MAX_KEY]}…" if key and len(key) > MAX_KEY else key
        super().__init__(
            " ".join(part for part in (where, f"{shown}:" if shown else "", message) if part)
        )

    @classmethod
    def join(cls, errors: Iterable[DescriptorError]) -> DescriptorError:
        """Join errors into one, listed on lines of their own, at most 50."""
        problems = list(errors)
        if len(problems) == 1:
            return problems[0]
        lines = [str(error) for error in problems[:MAX_SHOWN]]
        if hidden := len(problems) - len(lines):
            lines.append(f"and {hidden} more problems")
        joined = cls("\n".join(lines))
        joined.path, joined.line, joined.key = problems[0].path, problems[0].line, problems[0].key
        return joined


class RecordingError(RobotdError):
    """A file is not a recording of robotd, is damaged, or fits no such robot."""


class PluginError(RobotdError):
    """A plugin is missing, duplicate, broken, or of another API version.

    The text names the distribution; ``robotd backends`` lists what is installed.
    """


class ConnectError(RobotdError):
    """Opening failed. ``failures`` maps the path of each failing child to its reason.

    The text has a line for each reason, with all children that failed for it. ``permanent``:
    another try cannot help before the computer is changed, so that the start-up makes none.
    """

    def __init__(
        self,
        message: str,
        failures: dict[str, str] | None = None,
        *,
        permanent: bool = False,
    ) -> None:
        self.failures = failures or {}
        self.permanent = permanent
        children: dict[str, list[str]] = {}
        for path, reason in self.failures.items():
            children.setdefault(reason, []).append(path)
        lines = [f"  {', '.join(paths)}: {reason}" for reason, paths in children.items()]
        super().__init__("\n".join([message, *lines]))


class OperationError(RobotdError):
    """A command failed or was rejected; nothing moved because of it."""


class InvalidArgument(OperationError, ValueError):
    """A value out of range; the text names thing, value and limit.

    Repeating the call cannot help.
    """


class NotReady(OperationError):
    """The engine or the axis is not in a state that allows the command.

    The same call works once the state has changed.
    """


class LateSetpoint(OperationError):
    """A setpoint that came too late and was not given to the device."""


class Unsupported(OperationError):
    """The backend does not have this feature.

    Args:
        feature: name of the feature, as its user knows it.
        backend: name of the backend; "" in a driver: the core fills it in.
    """

    def __init__(self, feature: str, backend: str = "") -> None:
        who = f"the {backend} backend" if backend else "this backend"
        super().__init__(f"{feature}: not supported by {who}")
        self.feature = feature
        self.backend = backend


class DeviceTimeout(RobotdError, TimeoutError):
    """The device did not reach the requested state in time; it may still do so."""


class AbandonedCall(DeviceTimeout):
    """A call into a plugin has not returned in its time limit; its thread is left to itself.

    A driver that gives up by itself raises ``DeviceTimeout``: it can be called again at once.
    """


def reason_of(error: Exception) -> str:
    """Return the text of ``error`` without its axis."""
    return error.reason if isinstance(error, RobotdError) else str(error)


def plugin_failure(error: BaseException, target: str) -> str:
    """Return ``KeyError: 'bus' (axes.py:12)``: an exception, and the line of a plugin's package.

    ``target``: a module of it, or an object as in an entry point, ``package.module:name``.
    """
    package, line = target.partition(":")[0].partition(".")[0], ""
    for frame, number in walk_tb(error.__traceback__):
        if str(frame.f_globals.get("__name__")).partition(".")[0] == package:
            line = f" ({Path(frame.f_code.co_filename).name}:{number})"
    return f"{type(error).__name__}: {_text_of(error)}{line}"


def _text_of(error: BaseException) -> str:
    """Return the text of an exception of others: of bounded length, fields of pydantic in a line.

    pydantic is not imported for it: an error of pydantic comes with it.
    """
    pydantic = sys.modules.get("pydantic_core")
    try:
        if pydantic and isinstance(error, pydantic.ValidationError):
            return "; ".join(_fields_of(error))[:MAX_FAILURE]
        return str(error)[:MAX_FAILURE]
    except Exception:  # noqa: BLE001 - it has no text
        return "without a text"


MAX_NAME = 100  # characters of a name that is compared with others: the time is their product


def _fields_of(error: Any) -> Iterator[str]:
    """Yield ``Feature.open: must be ... (value 3)`` for each problem of an error of pydantic.

    A field that was given by its place has a number: the name is that of the object being made.
    """
    made = [frame.f_locals.get("__dataclass_self__") for frame, _ in walk_tb(error.__traceback__)]
    owner = next((cls for cls in made if type(cls).__name__ == error.title), None)
    names = list(getattr(owner, "__dataclass_fields__", ()))
    for detail in error.errors():
        first, *others = detail["loc"] or ("",)
        if isinstance(first, int) and first < len(names):
            first = names[first]
        place = ".".join(str(key) for key in (error.title, first, *others) if key != "")
        text = detail["msg"].removeprefix("Value error, ").replace("Input should be", "must be")
        yield f"{place}: {text} (value {detail['input']!r:.60})"


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return ``; did you mean 'x'?`` for the nearest known name, else ""."""
    near = get_close_matches(name[:MAX_NAME], list(known), n=1)
    return f"; did you mean {near[0]!r}?" if near else ""


def unknown_name(what: str, name: str, known: Iterable[str]) -> str:
    """Return ``unknown node 'x'; did you mean 'y'? (available: y, z)``."""
    names = list(known)
    available = ", ".join(names) or "none"
    return f"unknown {what} {name!r}{did_you_mean(name, names)} (available: {available})"
