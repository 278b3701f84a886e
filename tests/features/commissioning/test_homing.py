"""End of a homing whose key is released, or whose user is gone."""

from __future__ import annotations

import threading
from typing import Any

import pytest

from robotd.errors import OperationError
from robotd_commissioning.commission_terminal import _Homing

WAIT_S = 10.0


class LateDrive:
    """Drive that begins to home after the first stop has come."""

    def __init__(self) -> None:
        self.homed = False
        self._called = threading.Semaphore(0)

    def stop(self) -> None:
        self._called.release()

    def home(self) -> None:
        self._called.acquire(timeout=WAIT_S)  # not under way yet: no effect
        if self._called.acquire(timeout=WAIT_S):
            raise OperationError("homing was interrupted")
        self.homed = True


def test_a_homing_that_begins_after_the_stop_is_stopped_again() -> None:
    drive: Any = LateDrive()
    homing = _Homing(drive)
    homing.hold(1.0)
    homing.end()
    assert homing.ended
    assert not drive.homed
    with pytest.raises(OperationError, match="the key was released"):
        homing.check()
