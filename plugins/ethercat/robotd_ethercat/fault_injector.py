"""Fault injection into simulated slaves, for the conformance checks."""

from __future__ import annotations

from typing import TypeAlias

from robotd.api import FaultInjector
from robotd_cia402.device import Cia402Device
from robotd_cia402.simulated_axis import switch_bit
from robotd_ethercat.master import Master
from robotd_ethercat.simulation import Simulation

EthercatDevice: TypeAlias = Cia402Device[Master, Simulation]


class EthercatFaultInjector(FaultInjector):
    """Fault injection into simulated slaves; not on real ones. Any thread, one at a time."""

    def __init__(self, device: EthercatDevice) -> None:
        self._master, self._simulation = device.master, device.simulation

    @property
    def in_process(self) -> bool:  # type: ignore[override]  # depends on the robot
        return self._simulation is not None

    def position(self, axis: int) -> float:
        return float(self._inject("position", f"{self._slave(axis)} position"))

    def move_by_hand(self, axis: int, delta: float) -> None:
        self._inject("move_by_hand", f"{self._slave(axis)} push {delta!r}")

    def trip(self, axis: int, code: int) -> None:
        self._inject("trip", f"{self._slave(axis)} trip {code}")

    def disconnect(self, axis: int) -> None:
        """Only of the last slave: on a line those behind it are lost, too."""
        if self._slave(axis) < max(self._master.slaves):
            raise self._unsupported("disconnect of a slave with others behind it")
        self._inject("disconnect", f"{self._slave(axis)} cut")

    def reconnect(self, axis: int) -> None:
        """The cable is back; the slave is taken back or needs communication started again."""
        self._inject("reconnect", f"{self._slave(axis)} join")

    def freeze(self, frozen: bool) -> None:
        self._inject("freeze", f"0 loss {1.0 if frozen else 0.0}")

    def press_switch(self, axis: int, switch: str, pressed: bool) -> None:
        bit = switch_bit(switch, self._master.axes[axis].scaling.polarity)
        self._inject("press_switch", f"{self._slave(axis)} press {bit} {int(pressed)}")

    def torque(self, axis: int) -> float:
        return float(self._inject("torque", f"{self._slave(axis)} torque"))

    def output_bit(self, byte: int, bit: int) -> bool:
        for module in self._master.options.io:
            offset = byte - module.output_byte
            if 0 <= offset < module.output_length:
                return self._inject("output_bit", f"{module.slave} output {offset} {bit}") == "1"
        raise self._unsupported("output_bit")

    def set_input_bit(self, byte: int, bit: int, value: bool) -> None:
        for module in self._master.options.io:
            offset = byte - module.input_byte
            if 0 <= offset < module.input_length:
                line = f"{module.slave} input {offset} {bit} {int(value)}"
                self._inject("set_input_bit", line)

    def _slave(self, axis: int) -> int:
        return self._master.axes[axis].drive.node.number

    def _inject(self, method: str, line: str) -> str:
        if self._simulation is None:
            raise self._unsupported(method)
        return self._simulation.inject(line)
