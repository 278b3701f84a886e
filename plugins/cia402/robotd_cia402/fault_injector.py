"""Fault injection into simulated nodes by lines of text, for the conformance checks."""

from __future__ import annotations

from typing import Any

from robotd.api import FaultInjector
from robotd_cia402.device import Cia402Device

_SWITCHES = ("negative_limit", "positive_limit", "home_switch")  # bits of object 0x60FD


class Cia402FaultInjector(FaultInjector):
    """Fault injection into simulated nodes; not on real ones. Any thread, one at a time.

    Args:
        disconnect, reconnect: commands to a node.
        freeze: command to the bus, without its last word: the part of the frames that is lost.
        in_line: a node that is cut off takes those behind it along, so that only the last can be.
    """

    def __init__(
        self,
        device: Cia402Device[Any, Any],
        *,
        disconnect: str,
        reconnect: str,
        freeze: str,
        in_line: bool = False,
    ) -> None:
        self._master, self._simulation = device.master, device.simulation
        self._fieldbus, self._in_line = device.fieldbus, in_line
        self._disconnect, self._reconnect, self._freeze = disconnect, reconnect, freeze

    @property
    def in_process(self) -> bool:  # type: ignore[override]  # depends on the robot
        return self._simulation is not None

    def position(self, axis: int) -> float:
        return float(self._inject_axis("position", axis, "position"))

    def torque(self, axis: int) -> float:
        return float(self._inject_axis("torque", axis, "torque"))

    def move_by_hand(self, axis: int, delta: float) -> None:
        self._inject_axis("move_by_hand", axis, f"push {delta!r}")

    def trip(self, axis: int, code: int) -> None:
        self._inject_axis("trip", axis, f"trip {code}")

    def disconnect(self, axis: int) -> None:
        if self._in_line and self._node(axis) < max(self._fieldbus.node_ids(0)):
            raise self._unsupported("disconnect of a slave with others behind it")
        self._inject("disconnect", f"{self._node(axis)} {self._disconnect}")

    def reconnect(self, axis: int) -> None:
        """The drive is back on the bus; starting communication again takes it in."""
        self._inject("reconnect", f"{self._node(axis)} {self._reconnect}")

    def freeze(self, frozen: bool) -> None:
        self._inject("freeze", f"{self._freeze} {float(frozen)}")

    def press_switch(self, axis: int, switch: str, pressed: bool) -> None:
        bit = _SWITCHES.index(switch)
        if self._master.axes[axis].scaling.polarity < 0:
            bit = (1, 0, 2)[bit]
        self._inject_axis("press_switch", axis, f"press {bit} {int(pressed)}")

    def output_bit(self, byte: int, bit: int) -> bool:
        for node, module in self._master.io.modules:
            offset = byte - module.output_byte
            if 0 <= offset < module.output_length:
                line = f"{node.number} output {offset} {bit}"
                return self._inject("output_bit", line) == "1"
        raise self._unsupported("output_bit")

    def set_input_bit(self, byte: int, bit: int, value: bool) -> None:
        for node, module in self._master.io.modules:
            offset = byte - module.input_byte
            if 0 <= offset < module.input_length:
                line = f"{node.number} input {offset} {bit} {int(value)}"
                self._inject("set_input_bit", line)
                return
        raise self._unsupported("set_input_bit")

    def _node(self, axis: int) -> int:
        number: int = self._master.axes[axis].drive.node.number
        return number

    def _inject_axis(self, method: str, axis: int, command: str) -> str:
        """Inject ``command`` into one axis of a drive: the simulation counts them from 0."""
        node = self._node(axis)
        axes = [one.axis for one in self._master.options.axes if self._node(one.axis) == node]
        return self._inject(method, f"{node} {command} {axes.index(axis)}")

    def _inject(self, method: str, line: str) -> str:
        if self._simulation is None:
            raise self._unsupported(method)
        answer: str = self._simulation.inject(line)
        return answer
