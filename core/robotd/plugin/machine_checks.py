"""Checks of a computer, and scans of a network, that backends and features bring.

Two entry-point groups: ``robotd.doctors`` has generators of findings, called as ``function(context:
MachineContext)``; ``robotd.scans`` has functions that list what is on a bus, called as
``function(options)`` with a mapping of texts, whose result ``robotd new-robot --bus`` reads. The
entry's name is the backend's. A doctor may be of use before its backend is installed; a second
distribution adds findings under ``BACKEND-WORD``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from robotd.descriptor import RobotDescriptor
from robotd.entry_points import installed_names, load_entry, plugin_errors
from robotd.errors import PluginError, RobotdError

DOCTORS, SCANS = "robotd.doctors", "robotd.scans"
MARKS = {"ok": "ok     ", "warning": "warning", "failed": "FAILED "}


@dataclass(frozen=True)
class Finding:
    """One finding about a computer.

    Attributes:
        verdict: "failed": a robot cannot run here; "warning": it runs worse than it could.
        what: the finding, one line.
        advice: the command, or the step, that mends it; "" for none.
    """

    verdict: Literal["ok", "warning", "failed"]
    what: str
    advice: str = ""

    @property
    def text(self) -> str:
        """The finding for people, the advice in a line of its own."""
        advice = f"\n         {self.advice}" if self.advice else ""
        return f"{MARKS[self.verdict]}  {self.what}{advice}"


@dataclass(frozen=True)
class MachineContext:
    """Argument of a doctor.

    Attributes:
        robots: whose sections and files are checked against the computer; may be empty.
        asks_devices: the doctor may open what it checks, as to list slaves; nothing moves.
        options: of the backend's own command, such as ``{"interface": "eth1"}``.
    """

    robots: tuple[RobotDescriptor, ...] = ()
    asks_devices: bool = False
    options: Mapping[str, str] = field(default_factory=dict)


Doctor = Callable[[MachineContext], Iterable[Finding]]
Scan = Callable[[Mapping[str, str]], Mapping[str, Any]]


def doctors() -> tuple[str, ...]:
    """Return the names of all doctors, sorted; imports none of them."""
    return tuple(sorted({*map(_backend_of, installed_names(DOCTORS).entries)}))


def diagnose(name: str, context: MachineContext) -> Iterator[Finding]:
    """Yield the findings of a doctor; one that fails is a finding, too."""
    names = installed_names(DOCTORS)
    for origin, reason in names.refused.items():
        if _backend_of(origin.name) == name:
            yield Finding("failed", reason, f"uninstall {origin.distribution}, or update it")
    own = [entry for entry in names.entries.values() if _backend_of(entry[0].name) == name]
    # robotd's own first: it says what is missing for the others.
    for origin, entry in sorted(own, key=lambda pair: (not pair[0].is_own, pair[0])):
        try:
            doctor: Doctor = load_entry(origin, entry)
        except PluginError as error:
            advice = "a library that it needs is missing or has moved: install "
            yield Finding("failed", str(error), f"{advice}{origin.distribution} again")
            continue
        try:
            with plugin_errors(f"doctor {origin}", origin.module):
                yield from map(_checked, doctor(context))
        except (RobotdError, OSError, ValueError) as error:
            yield Finding("failed", f"{name}: {error}")


def _backend_of(name: str) -> str:
    """Return ``acme`` for the doctors ``acme`` and ``acme-device``."""
    return name.partition("-")[0]


def _checked(finding: object) -> Finding:
    if not isinstance(finding, Finding):
        raise TypeError(f"yields {type(finding).__name__}, not a Finding")
    return finding


def scan_network(name: str, options: Mapping[str, str], install: str) -> Mapping[str, Any]:
    """List what is on a backend's network.

    Args:
        name: of the backend.
        options: of its command.
        install: how the backend is installed, for the error.

    Raises PluginError: it is not installed or does not load. ConnectError: the scan fails.
    """
    if found := installed_names(SCANS).require(name):
        scan: Scan = load_entry(*found)
        with plugin_errors(f"scan {found[0]}", found[0].module):
            return scan(options)
    text = f"the backend robotd-{name} is not installed: {install}"
    raise PluginError(f"{text}; 'robotd {name} doctor' shows what is missing on this machine")
