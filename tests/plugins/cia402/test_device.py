"""Life cycle of the device of a fieldbus."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from tests.plugins.cia402.looped_drive import LoopedDrive
from tests.plugins.cia402.test_axes import LoopedAxes

from robotd.api import ConnectionState, NotReady
from robotd_cia402.device import Cia402Device


class SlowBus(LoopedAxes):
    """Bus that calls ``meanwhile`` before it communicates."""

    bus_name = "loop"

    def __init__(self, meanwhile: Callable[[], None]) -> None:
        super().__init__(LoopedDrive())
        self.state = ConnectionState.RUNNING
        self._meanwhile = meanwhile

    def start(self, timeout_s: float) -> None:
        self._meanwhile()
        self.state = ConnectionState.COMMUNICATING

    def end(self) -> None:
        self.state = ConnectionState.RUNNING


@pytest.mark.parametrize("ending", ["stop_communication", "close"])
def test_a_start_that_has_been_given_up_does_not_communicate(ending: str) -> None:
    """Its call has timed out, and was undone while it went on."""

    def give_up() -> None:
        if ending == "close":
            device.close()
        else:
            device.stop_communication(0.1)

    device: Cia402Device[Any, Any] = Cia402Device(SlowBus(give_up), None, None)  # type: ignore[arg-type]
    with pytest.raises(NotReady, match="communication was stopped while it started"):
        device.start_communication(1.0)
    assert device.state() is ConnectionState.RUNNING
    device.master._meanwhile = lambda: None
    device.start_communication(1.0)
    assert device.state() is ConnectionState.COMMUNICATING
