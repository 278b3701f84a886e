"""Fault injection into simulated drives, for the conformance checks."""

from __future__ import annotations

from functools import partial
from typing import TypeAlias

from robotd.api import FaultInjector
from robotd_canopen.master import Master
from robotd_canopen.simulated import DriveNode, IoNode, SimulatedNetwork
from robotd_canopen.simulated_robot import Simulation
from robotd_cia402.device import Cia402Device
from robotd_cia402.simulated import Drive
from robotd_cia402.simulated_axis import switch_bit

CanopenDevice: TypeAlias = Cia402Device[Master, Simulation]


class CanopenFaultInjector(FaultInjector):
    """Fault injection into drives simulated in this process; not on real drives. Any thread."""

    def __init__(self, device: CanopenDevice) -> None:
        self._device = device

    @property
    def in_process(self) -> bool:  # type: ignore[override]  # depends on the robot
        return self._device.simulation is not None

    def position(self, axis: int) -> float:
        drive = self._drive("position", axis)
        return drive.position

    def move_by_hand(self, axis: int, delta: float) -> None:
        drive = self._drive("move_by_hand", axis)
        self._network("move_by_hand").call(lambda: drive.push(delta))

    def trip(self, axis: int, code: int) -> None:
        drive = self._drive("trip", axis)
        self._network("trip").call(lambda: drive.trip(code))

    def disconnect(self, axis: int) -> None:
        self._node("disconnect", axis).faults.silent = True

    def reconnect(self, axis: int) -> None:
        """The drive is back on the bus; starting communication again takes it in."""
        self._node("reconnect", axis).faults.silent = False

    def freeze(self, frozen: bool) -> None:
        for node in self._network("freeze").members.values():
            node.faults.pdo_drop = 1.0 if frozen else 0.0

    def press_switch(self, axis: int, switch: str, pressed: bool) -> None:
        drive = self._drive("press_switch", axis)
        bit = switch_bit(switch, self._device.master.axes[axis].scaling.polarity)
        self._network("press_switch").call(lambda: drive.press(bit, pressed=pressed))

    def torque(self, axis: int) -> float:
        return self._drive("torque", axis).torque

    def output_bit(self, byte: int, bit: int) -> bool:
        network = self._network("output_bit")
        for module in self._device.master.layout.io:
            options, node = module.options, network.members[module.options.node]
            offset = byte - options.output_byte
            if isinstance(node, IoNode) and 0 <= offset < options.output_length:
                return bool(node.outputs[offset] >> bit & 1)
        raise self._unsupported("output_bit")

    def set_input_bit(self, byte: int, bit: int, value: bool) -> None:
        network = self._network("set_input_bit")
        for module in self._device.master.layout.io:
            options, node = module.options, network.members[module.options.node]
            offset = byte - options.input_byte
            if isinstance(node, IoNode) and 0 <= offset < options.input_length:
                network.call(partial(node.set_input_bit, offset, bit, value=value))

    def _network(self, method: str) -> SimulatedNetwork:
        if self._device.simulation is None:
            raise self._unsupported(method)
        return self._device.simulation.network

    def _node(self, method: str, axis: int) -> DriveNode:
        number = self._device.master.axes[axis].drive.node.number
        node = self._network(method).members[number]
        if not isinstance(node, DriveNode):
            raise self._unsupported(method)
        return node

    def _drive(self, method: str, axis: int) -> Drive:
        offset = self._device.master.layout.axes[axis].options.axis_offset
        drives = self._node(method, axis).drives
        return next(drive for drive in drives if drive.axis_offset == offset)
