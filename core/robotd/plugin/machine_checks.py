"""Checks of a computer, and scans of a network, that backends and features bring.

Two entry-point groups: ``robotd.doctors`` has generators of findings, called as ``function(context:
MachineContext)``; ``robotd.scans`` has functions that list what is on a bus, called as
``function(options)`` with a mapping of texts, whose result ``robotd new-robot --bus`` reads. The
entry's name is the backend's. A doctor may be of use before its backend is installed, and a second
distribution may add findings under the same name.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from robotd.descriptor import RobotDescriptor
from robotd.entry_points import entry_points
from robotd.errors import PluginError, RobotdError

DOCTORS, SCANS = "robotd.doctors", "robotd.scans"
MARKS = {"ok": "ok     ", "warning": "warning", "failed": "FAILED "}


@dataclass(frozen=True)
class Finding:
    """One finding about a computer.

    Attributes:
        verdict: "failed": a robot cannot run here; "warning": it runs worse than it could.
        what: what was found, one line.
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
    return tuple(sorted({entry.name for entry in entry_points(group=DOCTORS)}))


def diagnose(name: str, context: MachineContext) -> Iterator[Finding]:
    """Yield the findings of a doctor; one that fails is a finding, too."""
    # robotd's own first: it says what is missing for the others.
    entries = sorted(
        entry_points(group=DOCTORS, name=name),
        key=lambda entry: (entry.dist is None or entry.dist.name != "robotd", entry.value),
    )
    for entry in entries:
        try:
            doctor: Doctor = entry.load()
        except Exception as error:  # noqa: BLE001 - of a third party
            origin = entry.dist.name if entry.dist else entry.value
            what = f"{name}: {origin} does not load: {error}"
            advice = f"a library that it needs is missing or has moved: install {origin} again"
            yield Finding("failed", what, advice)
            continue
        try:
            yield from doctor(context)
        except (RobotdError, OSError, ValueError) as error:
            yield Finding("failed", f"{name}: {error}")


def scan_network(name: str, options: Mapping[str, str], install: str) -> Mapping[str, Any]:
    """List what is on a backend's network.

    Args:
        name: of the backend.
        options: of its command.
        install: how the backend is installed, for the error.

    Raises PluginError: it is not installed or does not load. ConnectError: the scan fails.
    """
    for entry in entry_points(group=SCANS, name=name):
        try:
            scan: Scan = entry.load()
        except ImportError as error:
            raise PluginError(f"the scan of {name} does not load: {error}") from error
        return scan(options)
    text = f"the backend robotd-{name} is not installed: {install}"
    raise PluginError(f"{text}; 'robotd {name} doctor' shows what is missing on this machine")
