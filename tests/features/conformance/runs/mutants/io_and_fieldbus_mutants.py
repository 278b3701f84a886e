"""Mutants: I/O and fieldbus diagnostics."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import (
    BusState,
    BusStatus,
    Capability,
    Unsupported,
)
from robotd_sim import SimFaultInjector, SimFieldbus, SimIo


class NeighboursClobbered(Mutant):
    breaks = ("IoDriver.write_output_bit/bit", "side effect")
    found_by = "test_io.py::test_a_bit_leaves_its_neighbours_alone"
    says = "outputs"

    class Io(SimIo):
        def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
            self.write_outputs(byte, bytes([int(value) << bit]))


class BitsGetLost(Mutant):
    """Read, change, write, without a lock."""

    breaks = ("IoDriver.write_output_bit/bit", "side effect")
    found_by = "test_threads.py::test_bits_written_at_once_are_all_there"
    says = "outputs from byte .* are .* not "

    class Io(SimIo):
        def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
            others = self.read_outputs(byte, 1)[0] & ~(1 << bit)
            time.sleep(0.0005)
            self.write_outputs(byte, bytes([others | int(value) << bit]))


class Boaster(Mutant):
    """Declares registers and cannot read them."""

    breaks = ("backend/declares", "ignored")
    found_by = "test_rejections.py::test_what_is_declared_is_there"
    says = "register_read"

    class Fieldbus(SimFieldbus):
        def read_register(self, bus: int, node: int, address: int, length: int) -> bytes:
            raise Unsupported(Capability.REGISTER_READ, "boaster")


class OutputsInMemoryOnly(Mutant):
    breaks = ("IoDriver.write_outputs/bytes", "ignored")
    found_by = "test_io.py::test_outputs_are_at_the_terminals"

    class Io(SimIo):
        def read_outputs(self, byte: int, length: int) -> bytes:
            shadow = self.__dict__.setdefault("shadow", bytearray(self.output_bytes))
            return bytes(shadow[byte : byte + length])

        def write_outputs(self, byte: int, data: bytes) -> None:
            self._require_open()
            shadow = self.__dict__.setdefault("shadow", bytearray(self.output_bytes))
            shadow[byte : byte + len(data)] = data

        def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
            others = self.read_outputs(byte, 1)[0] & ~(1 << bit)
            self.write_outputs(byte, bytes([others | int(value) << bit]))


class OutputsAreInputs(Mutant):
    breaks = ("IoDriver.read_inputs/bytes", "wrong value")
    found_by = "test_io.py::test_outputs_are_no_inputs"

    class Io(SimIo):
        def read_inputs(self, byte: int, length: int) -> bytes:
            return self.read_outputs(byte, length)


class WritesWhileClosed(Mutant):
    breaks = ("drivers/rejects", "ignored")
    found_by = "test_io.py::test_nothing_is_written_while_no_device_is_open"

    class Io(SimIo):
        def _require_open(self) -> None:
            pass


class CountersAlwaysZero(Mutant):
    breaks = ("FieldbusDriver.status/status", "wrong value")
    found_by = "test_fieldbus.py::test_lost_frames_are_counted_until_a_reset"

    class Fieldbus(SimFieldbus):
        def status(self, bus: int) -> BusStatus:
            status = super().status(bus)
            status.__dict__["lost_frames"] = 0
            return status


class CountersNeverReset(Mutant):
    breaks = ("FieldbusDriver.reset_statistics/zero", "ignored")
    found_by = "test_fieldbus.py::test_lost_frames_are_counted_until_a_reset"

    class Fieldbus(SimFieldbus):
        def reset_statistics(self, bus: int) -> None:
            pass


class AxesMiscounted(Mutant):
    breaks = ("FieldbusDriver.status/status", "wrong value")
    found_by = "test_fieldbus.py::test_the_nodes_have_as_many_axes_as_the_bus"

    class Fieldbus(SimFieldbus):
        def status(self, bus: int) -> BusStatus:
            status = super().status(bus)
            status.__dict__["axes"] = 8
            return status


class AlwaysOperational(Mutant):
    breaks = ("FieldbusDriver.status/states", "stale")
    found_by = "test_fieldbus.py::test_a_bus_that_exchanges_nothing_is_not_operational"

    class Fieldbus(SimFieldbus):
        def status(self, bus: int) -> BusStatus:
            status = super().status(bus)
            status.__dict__["state"] = BusState.OPERATIONAL
            return status


class WrongNodeIsLost(Mutant):
    breaks = ("FieldbusDriver.status/status", "wrong axis")
    found_by = "test_fieldbus.py::test_the_lost_node_is_the_one_that_was_lost"

    class Fieldbus(SimFieldbus):
        def status(self, bus: int) -> BusStatus:
            status = super().status(bus)
            if any(node.offline for node in status.nodes):
                nodes = tuple(replace(node, offline=node.id == 0) for node in status.nodes)
                status.__dict__["nodes"] = nodes
            return status


class RegistersConstant(Mutant):
    breaks = ("FieldbusDriver.read_register/memory", "wrong value")
    found_by = "test_fieldbus.py::test_registers_differ_from_each_other_and_between_nodes"

    class Fieldbus(SimFieldbus):
        def read_register(self, bus: int, node: int, address: int, length: int) -> bytes:
            return bytes(length)


class RegistersOfNodeZero(Mutant):
    breaks = ("FieldbusDriver.read_register/memory", "wrong axis")
    found_by = "test_fieldbus.py::test_registers_differ_from_each_other_and_between_nodes"

    class Fieldbus(SimFieldbus):
        def read_register(self, bus: int, node: int, address: int, length: int) -> bytes:
            return super().read_register(bus, 0, address, length)


class OutputsInverted(Mutant):
    breaks = ("IoDriver.write_outputs/bytes", "wrong value")
    found_by = "test_io.py::test_outputs_are_at_the_terminals"

    class Io(SimIo):
        def read_outputs(self, byte: int, length: int) -> bytes:
            return bytes(255 - value for value in super().read_outputs(byte, length))

        def write_outputs(self, byte: int, data: bytes) -> None:
            super().write_outputs(byte, bytes(255 - byte for byte in data))

        def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
            super().write_output_bit(byte, bit, not value)


class OutputBitsReversed(Mutant):
    breaks = ("IoDriver.write_outputs/bytes", "wrong value")
    found_by = "test_io.py::test_outputs_are_at_the_terminals"

    class Injector(SimFaultInjector):
        def output_bit(self, byte: int, bit: int) -> bool:
            return super().output_bit(byte, 7 - bit)


class InputBitsReversed(Mutant):
    breaks = ("IoDriver.read_inputs/bytes", "wrong value")
    found_by = "test_io.py::test_an_input_shows_its_sensor"

    class Io(SimIo):
        def read_inputs(self, byte: int, length: int) -> bytes:
            inputs = super().read_inputs(byte, length)
            return bytes(int(f"{byte:08b}"[::-1], 2) for byte in inputs)


class InputsLatched(Mutant):
    breaks = ("IoDriver.read_inputs/bytes", "stale")
    found_by = "test_io.py::test_an_input_shows_its_sensor"

    class Io(SimIo):
        def read_inputs(self, byte: int, length: int) -> bytes:
            seen = self.__dict__.setdefault("seen", bytearray(self.input_bytes))
            for place, value in enumerate(super().read_inputs(byte, length), byte):
                seen[place] |= value
            return bytes(seen[byte : byte + length])


class FirstOutputClearedByAnyWrite(Mutant):
    breaks = ("IoDriver.write_outputs/bytes", "side effect")
    found_by = "test_io.py::test_the_other_outputs_stay_as_they_are"

    class Io(SimIo):
        def write_outputs(self, byte: int, data: bytes) -> None:
            super().write_outputs(byte, data)
            if byte:
                super().write_outputs(0, bytes(1))


class CountersResetByReading(Mutant):
    breaks = ("FieldbusDriver.status/status", "side effect")
    found_by = "test_fieldbus.py::test_lost_frames_are_counted_until_a_reset"

    class Fieldbus(SimFieldbus):
        def status(self, bus: int) -> BusStatus:
            status = super().status(bus)
            self.reset_statistics(bus)
            return status


class NodesTwice(Mutant):
    breaks = ("FieldbusDriver.status/status", "wrong value")
    found_by = "test_fieldbus.py::test_the_slaves_are_told_apart"

    class Fieldbus(SimFieldbus):
        def status(self, bus: int) -> BusStatus:
            status = super().status(bus)
            return replace(status, nodes=status.nodes * 2)


class NodeIdsByPosition(Mutant):
    breaks = ("FieldbusDriver.node_ids/ids", "wrong value")
    found_by = "test_fieldbus.py::test_the_slaves_are_told_apart"

    class Fieldbus(SimFieldbus):
        def node_ids(self, bus: int) -> Sequence[int]:
            return range(1, 1 + len(super().node_ids(bus)))


class AxesOnOneNode(Mutant):
    breaks = ("FieldbusDriver.status/status", "wrong value")
    found_by = "test_fieldbus.py::test_the_nodes_have_as_many_axes_as_the_bus"

    class Fieldbus(SimFieldbus):
        def status(self, bus: int) -> BusStatus:
            status = super().status(bus)
            nodes = [replace(node, axes=0) for node in status.nodes]
            return replace(status, nodes=tuple(nodes))


class LostNodeNotShown(Mutant):
    breaks = ("FieldbusDriver.status/status", "stale")
    found_by = "test_fieldbus.py::test_a_lost_slave_is_shown"

    class Fieldbus(SimFieldbus):
        def status(self, bus: int) -> BusStatus:
            status = super().status(bus)
            nodes = [
                replace(node, offline=False, state=BusState.OPERATIONAL) for node in status.nodes
            ]
            return replace(status, nodes=tuple(nodes))


class RegistersFromZero(Mutant):
    breaks = ("FieldbusDriver.read_register/memory", "wrong value")
    found_by = "test_fieldbus.py::test_registers_have_the_length_that_was_asked_for"

    class Fieldbus(SimFieldbus):
        def read_register(self, bus: int, node: int, address: int, length: int) -> bytes:
            return super().read_register(bus, node, 0, length)


class HotConnectEnables(Mutant):
    breaks = ("FieldbusDriver.start_hot_connect/joins", "side effect")
    found_by = "test_faults.py::test_a_drive_that_is_back_stays_off"

    class Fieldbus(SimFieldbus):
        def start_hot_connect(self, bus: int) -> None:
            super().start_hot_connect(bus)
            simulation = self._simulation
            for axis in range(simulation.axes):
                later = partial(simulation.power.request, axis, on=True)
                simulation.world.at(simulation.world.tick + 400, later)


class HotConnectDoesNothing(Mutant):
    breaks = ("FieldbusDriver.start_hot_connect/joins", "ignored")
    found_by = "test_faults.py::test_a_drive_that_is_back_stays_off"

    class Fieldbus(SimFieldbus):
        def start_hot_connect(self, bus: int) -> None:
            pass
