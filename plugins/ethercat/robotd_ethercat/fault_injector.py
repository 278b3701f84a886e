"""Fault injection into simulated slaves, for the conformance checks."""

from __future__ import annotations

from typing import TypeAlias

from robotd_cia402.device import Cia402Device
from robotd_cia402.fault_injector import Cia402FaultInjector
from robotd_ethercat.master import Master
from robotd_ethercat.slaves_process import Simulation

EthercatDevice: TypeAlias = Cia402Device[Master, Simulation]


class EthercatFaultInjector(Cia402FaultInjector):
    """Fault injection into slaves that are simulated in a process of their own."""

    def disconnect(self, axis: int) -> None:
        """Only of the last slave: on a line those behind it are lost, too."""
        if self._node(axis) < max(self._master.slaves):
            raise self._unsupported("disconnect of a slave with others behind it")
        self._inject("disconnect", f"{self._node(axis)} cut")

    def reconnect(self, axis: int) -> None:
        """The cable is back; the slave is taken back or needs communication started again."""
        self._inject("reconnect", f"{self._node(axis)} join")

    def freeze(self, frozen: bool) -> None:
        self._inject("freeze", f"0 loss {float(frozen)}")
