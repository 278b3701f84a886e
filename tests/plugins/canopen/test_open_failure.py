"""Errors of a CAN bus that does not open."""

from __future__ import annotations

import errno

import can
import pytest

from robotd.errors import ConnectError
from robotd_canopen.bus import Bus
from robotd_canopen.options import BusOptions


@pytest.mark.parametrize(
    ("raised", "says", "permanent"),
    [
        (OSError(errno.EAFNOSUPPORT, "Address family not supported"), "modprobe can", True),
        (OSError(errno.ENODEV, "No such device"), "there is no such interface", True),
        (PermissionError(errno.EPERM, "Operation not permitted"), "no permission", True),
        (can.CanInterfaceNotImplementedError("no module"), "no module", True),
        (OSError(errno.ENETDOWN, "Network is down"), "canopen → socketcan:can7: Network", False),
        (can.CanInitializationError("busy"), "CanInitializationError: busy", False),
    ],
)
def test_only_an_error_that_can_pass_is_tried_again(
    monkeypatch: pytest.MonkeyPatch, raised: Exception, says: str, permanent: bool
) -> None:
    def fail(**_: object) -> None:
        raise raised

    monkeypatch.setattr(can, "Bus", fail)
    with pytest.raises(ConnectError) as caught:
        Bus(BusOptions(interface="socketcan", channel="can7")).open()
    assert says in str(caught.value)
    assert "Errno" not in str(caught.value)
    assert caught.value.permanent == permanent
