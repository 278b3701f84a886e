"""``robotd wmx scan``: the EtherCAT network through the engine of the WMX backend."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from robotd.errors import PluginError
from robotd.plugin.known_backends import not_installed

SCANS = "robotd.wmx_scan"


def scan_network(root: Path | None) -> Mapping[str, Any]:
    """Return the slaves; the backend, where it is installed, brings the function.

    Raises PluginError: it is not installed or does not load. ConnectError: the scan fails.
    """
    for entry in entry_points(group=SCANS):
        try:
            scan: Callable[[Path | None], Mapping[str, Any]] = entry.load()
        except ImportError as error:
            raise PluginError(f"the backend robotd-wmx does not load: {error}") from error
        return scan(root)
    raise PluginError(not_installed("wmx"))


def slave_lines(found: Mapping[str, Any]) -> Iterator[str]:
    """Yield one line for each slave, and their number."""
    for slave in found["slaves"]:
        modes = " ".join(slave["modes"])
        yield (
            f"master {slave['master']} slave {slave['slave']:3}: {slave['axes']} axes,"
            f" vendor 0x{slave['vendor_id']:08X}, product 0x{slave['product_code']:08X},"
            f" revision 0x{slave['revision']:08X}, serial {slave['serial']},"
            f" {slave['state']}{f'; {modes}' if modes else ''}"
        )
    count = len(found["slaves"])
    yield f"{count} slave{'' if count == 1 else 's'}"
