"""Backends that exist and are distributed separately, for those who do not have them installed."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class KnownBackend:
    """Description of a backend outside the core distribution.

    Attributes:
        summary: hardware that it drives.
        install: command, and the machine on which it works.
        page: documentation.
        doctor: command that finds what is missing.
    """

    summary: str
    install: str
    page: str
    doctor: str


KNOWN_BACKENDS = {
    "wmx": KnownBackend(
        "WMX3 motion engine with its EtherCAT master",
        "pip install ./plugins/wmx, on the machine that has the WMX3 SDK",
        "docs/how-to/wmx.md",
        "robotd wmx doctor",
    )
}


def not_installed(name: str) -> str:
    """Describe a known backend and its installation; "" if unknown."""
    known = KNOWN_BACKENDS.get(name)
    if known is None:
        return ""
    return (
        f"backend {name!r} ({known.summary}) is not installed: {known.install} ({known.page});"
        f" '{known.doctor}' shows what is missing on this machine"
    )
