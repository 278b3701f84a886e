"""Simulated servo drive and simulated digital I/O module."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from robotd_canopen.simulated.simulated_node import OPERATIONAL, SimulatedNode
from robotd_cia402.simulated.drive import Drive, DriveModel
from robotd_cia402.simulated.motors import Motors

_OUTPUTS, _INPUTS = 0x6200, 0x6000
_MAX_BYTES = 8
_OVER_VOLTAGE = 0x3210


class DriveNode(SimulatedNode):
    """A drive with one axis or several, each with its motor in ``machine``."""

    def __init__(
        self,
        node_id: int,
        eds: Path,
        machine: Motors,
        models: Sequence[DriveModel],
        identity: dict[int, int] | None = None,
    ) -> None:
        super().__init__(node_id, eds, identity)
        self.drives = [
            Drive(model, self.values, machine, self.faults, self.emergency) for model in models
        ]
        for drive in self.drives:
            drive.power_on()

    def boot(self, now_ns: int) -> None:
        super().boot(now_ns)
        for drive in self.drives:
            drive.power_on()

    def sync(self, period_s: float) -> None:
        """Act on the synchronous objects, which have taken effect."""
        if self.state == OPERATIONAL:
            for drive in self.drives:
                drive.sync(period_s)

    def sample(self, period_s: float) -> None:
        for drive in self.drives:
            drive.sample(period_s)

    def on_event(self) -> None:
        self.sync(0.001)

    def on_connection_lost(self) -> None:
        for drive in self.drives:
            drive.connection_lost()

    def trip(self, code: int = _OVER_VOLTAGE) -> None:
        """A fault of the power stage on all axes."""
        for drive in self.drives:
            drive.trip(code)


class IoNode(SimulatedNode):
    """A CiA 401 module. With ``loopback`` its inputs are wired to its outputs."""

    def __init__(
        self,
        node_id: int,
        eds: Path,
        identity: dict[int, int] | None = None,
        *,
        loopback: bool = False,
    ) -> None:
        self.loopback = loopback
        super().__init__(node_id, eds, identity)

    @property
    def outputs(self) -> bytes:
        """The output bytes as they are now."""
        return bytes(self.values[_OUTPUTS, sub] for sub in range(1, _MAX_BYTES + 1))

    def set_input(self, byte: int, value: int) -> None:
        """An input byte of the module changes."""
        self.values[_INPUTS, byte + 1] = value
        self._report()

    def set_input_bit(self, byte: int, bit: int, *, value: bool) -> None:
        """One input of the module changes."""
        before = self.values[_INPUTS, byte + 1]
        self.set_input(byte, before & ~(1 << bit) | int(value) << bit)

    def on_event(self) -> None:
        if self.loopback:
            for sub in range(1, _MAX_BYTES + 1):
                self.values[_INPUTS, sub] = self.values[_OUTPUTS, sub]
        self._report()

    def on_written(self, index: int, sub: int) -> None:
        if index == _OUTPUTS:
            self.on_event()

    def on_operational(self) -> None:
        self._report(always=True)

    def _report(self, *, always: bool = False) -> None:
        if self.state == OPERATIONAL:
            for cob_id, data in self.pdos.changed(always=always):
                self.send(cob_id, data)
