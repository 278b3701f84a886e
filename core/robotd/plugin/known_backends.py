"""Backends that exist and are distributed separately, for those who do not have them installed."""

from __future__ import annotations

WMX_INSTALL = "pip install ./plugins/wmx, on the machine that has the WMX3 SDK"

_NOT_INSTALLED = {
    "wmx": (
        "backend 'wmx' (WMX3 motion engine with its EtherCAT master) is not installed:"
        f" {WMX_INSTALL} (docs/how-to/wmx.md);"
        " 'robotd wmx doctor' shows what is missing on this machine"
    )
}


def not_installed(name: str) -> str:
    """Describe a known backend and its installation; "" if unknown."""
    return _NOT_INSTALLED.get(name, "")
