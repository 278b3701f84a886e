"""Entry points of what is installed: where robotd finds plugins, features and commands.

One rule for the names of all groups: a name that robotd's own distribution has is robotd's; one
that several others have belongs to none of them. ``importlib.metadata.entry_points`` reads a file
of every distribution at each call, 12 ms with 150 of them; a start asks six times. What is
installed later is found by the next process.
"""

from __future__ import annotations

import importlib.metadata
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, lru_cache, partial
from importlib.metadata import Distribution, EntryPoint, EntryPoints
from typing import Any, NamedTuple

from robotd.call_timeout import CallTimeout, call_with_timeout
from robotd.errors import PluginError, RobotdError, plugin_failure

API_VERSION = 1
OWN = "robotd"  # distribution
IMPORT_LIMIT_S = 30.0
KINDS = {
    "robotd.backends": "plugin",
    "robotd.bases": "kind of base",
    "robotd.checks": "check",
    "robotd.codes": "code table",
    "robotd.commands": "command",
    "robotd.doctors": "doctor",
    "robotd.exports": "export",
    "robotd.features": "feature",
    "robotd.plugins": "plugin",
    "robotd.scans": "scan",
}
"""All groups, and what an entry of each is called in texts."""

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
_VALUE = re.compile(r"[\w.]+(:[\w.]+)?")


@dataclass(frozen=True, order=True)
class PluginOrigin:
    """Origin of a plugin: entry point ``name`` of a distribution, and its module."""

    name: str
    module: str
    distribution: str
    version: str

    def __str__(self) -> str:
        if self == OWNER:
            return OWN
        return f"{self.name!r} ({self.module} of {self.release})"

    @property
    def is_own(self) -> bool:
        """True for robotd's own distribution."""
        return self.distribution == OWN

    @property
    def release(self) -> str:
        """Distribution and version: ``acme 1.2``."""
        return f"{self.distribution} {self.version}"


OWNER = PluginOrigin(OWN, OWN, OWN, "")
"""Claimant of names that robotd has without an entry point."""


class Names(NamedTuple):
    """Names of one group.

    Attributes:
        entries: entry points that can be used, by name and sorted, with their origins.
        refused: why others cannot be, sorted.
    """

    entries: Mapping[str, tuple[PluginOrigin, EntryPoint]]
    refused: Mapping[PluginOrigin, str]

    def require(self, name: str) -> tuple[PluginOrigin, EntryPoint] | None:
        """Return the entry called ``name``; None without one. Raises PluginError: it is refused."""
        reasons = [text for origin, text in self.refused.items() if origin.name == name]
        if name not in self.entries and reasons:
            raise PluginError("\n".join(reasons))
        return self.entries.get(name)


def rivals(
    claims: Iterable[tuple[str, PluginOrigin]],
) -> dict[tuple[str, PluginOrigin], PluginOrigin]:
    """Return the claims of names that are refused, each with who else claims the name.

    robotd's own claims never are; of others that claim one name all are.
    """
    claimants: dict[str, dict[PluginOrigin, None]] = {}
    for name, claimant in claims:
        claimants.setdefault(name, {})[claimant] = None
    return {
        (name, claimant): min(others, key=lambda origin: (not origin.is_own, origin))
        for name, several in claimants.items()
        for claimant in several
        if not claimant.is_own and (others := several.keys() - {claimant})
    }


def installed_names(group: str) -> Names:
    """Return the names of a group and who has each; imports nothing. Any thread."""
    return _names(tuple(sys.path), group)


def load_entry(origin: PluginOrigin, entry: EntryPoint) -> Any:
    """Import the object of an entry point, within 30 s of the computer's time. Any thread.

    Raises PluginError, with the distribution: it fails, or is not done in time.
    """
    what = f"{KINDS[entry.group]} {origin} cannot be imported"
    try:
        return call_with_timeout(IMPORT_LIMIT_S, entry.load, f"import {origin.module}")
    except CallTimeout as late:
        text = f"{what}: not done within {IMPORT_LIMIT_S:g} s{late.note}"
        raise PluginError(text) from None
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # of a third party, which may raise anything
        text = f"{what}: {plugin_failure(error, origin.module)}{_version_hint(error)}"
        raise PluginError(text) from error


@contextmanager
def plugin_errors(
    what: str, module: str, unchanged: tuple[type[BaseException], ...] = ()
) -> Iterator[None]:
    """Name the plugin whose code raises: RobotdError is unchanged, others are PluginError.

    Args:
        what: plugin and part, for the text.
        module: of it, or object as in an entry point.
        unchanged: further errors that are not the plugin's fault.
    """
    try:
        yield
    except BaseException as error:
        if isinstance(error, (RobotdError, KeyboardInterrupt, *unchanged)):
            raise
        raise PluginError(f"{what} failed: {plugin_failure(error, module)}") from error


def module_of(function: Callable[..., Any]) -> str:
    """Return the module of a function, a method, a partial or another callable."""
    while isinstance(function, partial):
        function = function.func
    return str(getattr(function, "__module__", None) or type(function).__module__)


def owner_of(module: str) -> str:
    """Return the release that a module belongs to: ``acme 1.2``; "" where it is not known.

    A distribution is known by the packages of its entry points. ``module``: also an object in it,
    ``package.module:name``. Any thread.
    """
    package = module.partition(":")[0].partition(".")[0]
    for group in KINDS:
        for origin, _ in installed_names(group).entries.values():
            if origin.module.partition(":")[0].partition(".")[0] == package:
                return origin.release
    return ""


def entry_points(*, group: str) -> EntryPoints:
    """Return the entry points of a group as they are installed, refused ones too. Any thread."""
    found: EntryPoints = _installed(tuple(sys.path))[0].select(group=group)
    return found


def unreadable() -> Mapping[str, str]:
    """Return why the entry points of distributions cannot be read, by their names."""
    return _installed(tuple(sys.path))[1]


@lru_cache(maxsize=1)
def _installed(path: tuple[str, ...]) -> tuple[Any, Mapping[str, str]]:
    """Read them all, and why some cannot be; ``path`` is what ``importlib.metadata`` searches."""
    del path
    try:
        return importlib.metadata.entry_points(), {}
    except Exception:  # noqa: BLE001 - a damaged file of one distribution hides those of all
        entries: list[EntryPoint] = []
        problems: dict[str, str] = {}
        for distribution in _distributions():
            try:
                entries += distribution.entry_points
            except Exception as error:  # noqa: BLE001 - of any kind
                name, version = _release(distribution)
                text = f"{type(error).__name__}: {error}"
                problems[name] = f"{name} {version}: entry_points.txt cannot be read: {text}"
        return EntryPoints(entries), problems


def _distributions() -> Iterable[Distribution]:
    """Return each distribution once: the first on the path."""
    found: dict[str, Distribution] = {}
    for distribution in importlib.metadata.distributions():
        found.setdefault(_release(distribution)[0], distribution)
    return found.values()


@lru_cache(maxsize=len(KINDS))
def _names(path: tuple[str, ...], group: str) -> Names:
    del path
    found = {_origin(entry): entry for entry in entry_points(group=group)}
    what = KINDS[group]
    refused: dict[PluginOrigin, str] = {}
    for origin in found:
        if not _NAME.fullmatch(origin.name):
            refused[origin] = (
                f"{what} {origin}: the name must begin with a letter and hold only letters,"
                " digits, _ and -"
            )
        elif not _VALUE.fullmatch(origin.module):
            refused[origin] = f"{what} {origin}: must be package.module or package.module:name"
    named = [origin for origin in found if origin not in refused]
    for (name, origin), other in rivals((origin.name, origin) for origin in named).items():
        refused[origin] = f"{what} {origin}: the name {name!r} is taken by {other}" + (
            "" if other.is_own else "; uninstall one of them"
        )
    entries = {
        origin.name: (origin, found[origin]) for origin in sorted(named) if origin not in refused
    }
    return Names(entries, dict(sorted(refused.items())))


def _origin(entry: EntryPoint) -> PluginOrigin:
    name, version = _release(entry.dist) if entry.dist else ("unknown", "?")
    return PluginOrigin(entry.name, entry.value, name, version)


@cache
def _release(distribution: Distribution) -> tuple[str, str]:
    # Each look at one of them parses the whole METADATA: half the time of `robotd --help`.
    try:
        metadata = distribution.metadata
        return metadata["Name"] or "unknown", metadata["Version"] or "?"
    except Exception:  # noqa: BLE001 - its METADATA is missing or damaged
        return "unknown", "?"


def _version_hint(error: BaseException) -> str:
    """A plugin of another API version imports names that this one does not have."""
    if isinstance(error, ImportError) and (error.name or "").partition(".")[0] == OWN:
        return f"; is it written for another plugin API? This is API {API_VERSION}"
    return ""
