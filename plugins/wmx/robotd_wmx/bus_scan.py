"""Scan of the EtherCAT networks through the engine, for ``robotd wmx scan``.

Nothing moves, no servo is switched, no communication is started.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from robotd.api import ConnectError
from robotd_wmx import _native
from robotd_wmx._native import CallError, Device, Master, Slave
from robotd_wmx.doctor import STATES
from robotd_wmx.errors import name_of, text_of

SUPPORTED_MODES = 0x6502  # CiA 402: bit n is mode n + 1
MODES = {1: "pp", 3: "pv", 4: "tq", 6: "hm", 7: "ip", 8: "csp", 9: "csv", 10: "cst"}
ENGINE_TIMEOUT_MS = 10_000


def scan(options: Mapping[str, str]) -> dict[str, Any]:
    """Return the slaves of all masters in the form that ``robotd new-robot --bus`` reads.

    Args:
        options: ``sdk``, the root of the SDK; by default the one of the binding.

    Raises ConnectError: the engine does not start, or a scan fails.
    """
    device = Device()
    try:
        device.create(f"{options.get('sdk', _native.SDK_PATH)}/", ENGINE_TIMEOUT_MS)
        try:
            device.set_name("robotd scan")
            slaves = list(_slaves(device))
        finally:
            device.close(False)
    except CallError as error:
        what, reason = f"wmx → {error.args[0]}", text_of(*error.args[1:3])
        raise ConnectError("the EtherCAT network cannot be scanned", {what: reason}) from error
    axes = [slave for slave in slaves for _ in range(slave["axes"])]
    return {"backend": "wmx", "options": {}, "axes": axes, "slaves": slaves}


def _slaves(device: Device) -> Iterator[dict[str, Any]]:
    for master in range(_native.MAX_MASTERS):
        try:
            device.scan_network(master)
            found = Master(device, master).slaves
        except CallError as error:
            if master and name_of(error) == "IDOutOfRange":
                return  # one master is the usual case
            raise
        for slave in found:
            yield _slave(device, master, slave)


def _slave(device: Device, master: int, slave: Slave) -> dict[str, Any]:
    return {
        "master": master,
        "slave": slave.id,
        "axes": slave.axes,
        "vendor_id": slave.vendor_id,
        "product_code": slave.product_code,
        "revision": slave.revision,
        "serial": slave.serial,
        "state": "offline" if slave.offline else STATES.get(slave.state, str(slave.state)),
        "modes": _modes(device, master, slave) if slave.axes and not slave.offline else [],
    }


def _modes(device: Device, master: int, slave: Slave) -> list[str]:
    """Return the modes that the first axis supports; empty where the slave does not say."""
    try:
        data, abort = device.sdo_upload(master, slave.id, SUPPORTED_MODES, 0)
    except CallError:
        return []  # known in the states that have a mailbox only
    bits = 0 if abort else int.from_bytes(data, "little")
    return [name for mode, name in MODES.items() if bits >> (mode - 1) & 1]
