"""Fault injection into simulated drives, for the conformance checks."""

from __future__ import annotations

from typing import TypeAlias

from robotd_canopen.master import Master
from robotd_canopen.simulated_robot import Simulation
from robotd_cia402.device import Cia402Device
from robotd_cia402.fault_injector import Cia402FaultInjector

CanopenDevice: TypeAlias = Cia402Device[Master, Simulation]


class CanopenFaultInjector(Cia402FaultInjector):
    """Fault injection into drives that are simulated in this process."""

    def disconnect(self, axis: int) -> None:
        self._inject("disconnect", f"{self._node(axis)} silence")

    def reconnect(self, axis: int) -> None:
        """The drive is back on the bus; starting communication again takes it in."""
        self._inject("reconnect", f"{self._node(axis)} silence 0")

    def freeze(self, frozen: bool) -> None:
        self._inject("freeze", f"all drop {float(frozen)}")
