"""Error of a CAN bus that does not open, with its remedy."""

from __future__ import annotations

import errno

import can

from robotd.api import ConnectError
from robotd_canopen.options import BusOptions

PERMANENT = {
    errno.EPERM: "no permission: run as a user who may use the adapter",
    errno.EACCES: "no permission: run as a user who may use the adapter",
    errno.EAFNOSUPPORT: "this kernel has no CAN (AF_CAN): sudo modprobe can can_raw",
    errno.EPROTONOSUPPORT: "this kernel has no raw CAN sockets: sudo modprobe can_raw",
    errno.ENODEV: "there is no such interface: ip -br link show type can lists them",
}


def open_failure(error: Exception, options: BusOptions) -> ConnectError:
    """Return the error for what opening the bus raised."""
    number = error.errno if isinstance(error, OSError) else None
    permanent = number in PERMANENT or isinstance(
        error, can.CanInterfaceNotImplementedError | ImportError
    )
    if number in PERMANENT:
        reason = PERMANENT[number]
    elif isinstance(error, OSError) and error.strerror:
        reason = error.strerror
    else:
        reason = f"{type(error).__name__}: {error}"
    path = f"canopen → {options.interface}:{options.channel}"
    return ConnectError("the CAN bus cannot be opened", {path: reason}, permanent=permanent)
