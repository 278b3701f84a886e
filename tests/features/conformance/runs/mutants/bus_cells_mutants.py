"""Mutants: I/O and fieldbus of other modules and nodes, again and in motion."""

from __future__ import annotations

import time

from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import BusStatus, ConnectionState, NotReady, OperationError
from robotd_sim import SimDevice, SimFieldbus, SimIo


class SecondModuleShifted(Mutant):
    breaks = ("IoDriver.read_inputs/bytes", "wrong value")
    found_by = "test_io.py::test_each_input_is_at_its_address"

    class Io(SimIo):
        def read_inputs(self, byte: int, length: int) -> bytes:
            whole = super().read_inputs(0, self.input_bytes)
            shifted = whole[:2] + whole[3:] + whole[2:3]
            return shifted[byte : byte + length]


class LastInputByteMissing(Mutant):
    breaks = ("IoDriver.read_inputs/bytes", "last axis")
    found_by = "test_io.py::test_each_input_is_at_its_address"

    class Io(SimIo):
        def read_inputs(self, byte: int, length: int) -> bytes:
            whole = super().read_inputs(0, self.input_bytes)[:-1] + b"\x00"
            return whole[byte : byte + length]


class ShortReadsFromZero(Mutant):
    breaks = ("IoDriver.read_inputs/bytes", "small")
    found_by = "test_io.py::test_each_input_is_at_its_address"

    class Io(SimIo):
        def read_inputs(self, byte: int, length: int) -> bytes:
            return super().read_inputs(0 if length == 1 else byte, length)


class ReadingClearsInputs(Mutant):
    breaks = ("IoDriver.read_inputs/bytes", "side effect")
    found_by = "test_io.py::test_each_input_is_at_its_address"

    class Io(SimIo):
        def read_inputs(self, byte: int, length: int) -> bytes:
            seen = super().read_inputs(byte, length)
            self._simulation.io.inputs[byte : byte + length] = bytes(length)
            return seen


class LiveImagesAreCopies(Mutant):
    breaks = ("IoDriver.live/images", "stale")
    found_by = "test_io.py::test_each_input_is_at_its_address"

    class Io(SimIo):
        @property
        def live(self) -> tuple[memoryview, memoryview]:
            first = self.__dict__.setdefault(
                "copies", (bytearray(self.input_bytes), bytearray(self.output_bytes))
            )
            return memoryview(first[0]), memoryview(first[1])


class InputsBlock(Mutant):
    breaks = ("IoDriver.read_inputs/blocks", "blocks")
    found_by = "test_io.py::test_reading_does_not_block"

    class Io(SimIo):
        def read_inputs(self, byte: int, length: int) -> bytes:
            time.sleep(0.005)
            return super().read_inputs(byte, length)


class OutputsBlock(Mutant):
    breaks = ("IoDriver.read_outputs/blocks", "blocks")
    found_by = "test_io.py::test_reading_does_not_block"

    class Io(SimIo):
        def read_outputs(self, byte: int, length: int) -> bytes:
            time.sleep(0.005)
            return super().read_outputs(byte, length)


class OutputBitToggles(Mutant):
    breaks = ("IoDriver.write_output_bit/bit", "second call")
    found_by = "test_io.py::test_an_output_that_is_written_again_stays"

    class Io(SimIo):
        def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
            now = bool(self.read_outputs(byte, 1)[0] >> bit & 1)
            super().write_output_bit(byte, bit, not now if value else False)


class OutputBitOnlySets(Mutant):
    breaks = ("IoDriver.write_output_bit/bit", "ignored")
    found_by = "test_io.py::test_a_bit_leaves_its_neighbours_alone"

    class Io(SimIo):
        def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
            if value or bit != 7:
                super().write_output_bit(byte, bit, value)


class OutputsFallBack(Mutant):
    breaks = ("IoDriver.write_outputs/bytes", "second call")
    found_by = "test_io.py::test_an_output_that_is_written_again_stays"

    class Io(SimIo):
        def write_outputs(self, byte: int, data: bytes) -> None:
            before = self.read_outputs(byte, len(data))
            super().write_outputs(byte, data)
            if before == data and byte:
                world = self._simulation.world
                with world.lock:
                    flipped = bytes(byte ^ 1 for byte in data)
                    world.at(world.tick + 30, lambda: self._simulation.io.write(byte, flipped))


class FourBytesAtMost(Mutant):
    breaks = ("IoDriver.write_outputs/bytes", "wrong value")
    found_by = "test_io.py::test_each_output_byte_is_at_its_address"

    class Io(SimIo):
        def write_outputs(self, byte: int, data: bytes) -> None:
            super().write_outputs(byte, data[:4])


class WritesLostAfterReopen(Mutant):
    breaks = ("IoDriver.write_outputs/bytes", "after re-open")
    found_by = "test_reopening.py::test_everything_works_again"

    class Device(SimDevice):
        def close(self) -> None:
            self.simulation.__dict__["closed"] = True
            super().close()

    class Io(SimIo):
        def write_outputs(self, byte: int, data: bytes) -> None:
            if not self._simulation.__dict__.get("closed"):
                super().write_outputs(byte, data)


class WriteObjectDoesNothing(Mutant):
    breaks = ("FieldbusDriver.write_object/writes", "ignored")
    found_by = "test_fieldbus.py::test_a_written_object_is_in_its_node"

    class Fieldbus(SimFieldbus):
        def write_object(self, bus: int, node: int, index: int, subindex: int, data: bytes) -> None:
            self.read_object(bus, node, index, subindex)


class WritesAnObjectOnce(Mutant):
    breaks = ("FieldbusDriver.write_object/writes", "second call")
    found_by = "test_fieldbus.py::test_a_written_object_is_in_its_node"

    class Fieldbus(SimFieldbus):
        def write_object(self, bus: int, node: int, index: int, subindex: int, data: bytes) -> None:
            done = self.__dict__.setdefault("done", set())
            if (node, index) not in done:
                super().write_object(bus, node, index, subindex, data)
            done.add((node, index))


class WritesToTheFirstNode(Mutant):
    breaks = ("FieldbusDriver.write_object/writes", "wrong axis")
    found_by = "test_fieldbus.py::test_a_written_object_is_in_its_node"

    class Fieldbus(SimFieldbus):
        def write_object(self, bus: int, node: int, index: int, subindex: int, data: bytes) -> None:
            super().write_object(bus, 0, index, subindex, data)


class WritingStopsAxes(Mutant):
    breaks = ("FieldbusDriver.write_object/nothing-moves", "side effect")
    found_by = "test_questions.py::test_what_does_not_concern_an_axis_leaves_it_alone"

    class Fieldbus(SimFieldbus):
        def write_object(self, bus: int, node: int, index: int, subindex: int, data: bytes) -> None:
            super().write_object(bus, node, index, subindex, data)
            with self._simulation.world.lock:
                for axis in range(self._simulation.axes):
                    self._simulation.motion.stop(axis)


class ObjectsOfTheFirstNode(Mutant):
    breaks = ("FieldbusDriver.read_object/value", "wrong axis")
    found_by = "test_fieldbus.py::test_a_written_object_is_in_its_node"

    class Fieldbus(SimFieldbus):
        def read_object(self, bus: int, node: int, index: int, subindex: int) -> bytes:
            self._slave(bus, node)
            return super().read_object(bus, 0, index, subindex)


class ObjectsFromACache(Mutant):
    breaks = ("FieldbusDriver.read_object/value", "stale")
    found_by = "test_fieldbus.py::test_a_written_object_is_in_its_node"

    class Fieldbus(SimFieldbus):
        def read_object(self, bus: int, node: int, index: int, subindex: int) -> bytes:
            cache, key = self.__dict__.setdefault("cache", {}), (node, index, subindex)
            if key not in cache:
                cache[key] = super().read_object(bus, node, index, subindex)
            return bytes(cache[key])


class ReadingAnObjectSwitchesOff(Mutant):
    breaks = ("FieldbusDriver.read_object/value", "side effect")
    found_by = "test_questions.py::test_questions_change_nothing"

    class Fieldbus(SimFieldbus):
        def read_object(self, bus: int, node: int, index: int, subindex: int) -> bytes:
            found = super().read_object(bus, node, index, subindex)
            if index == 0x1018 and node:
                with self._simulation.world.lock:
                    self._simulation.motion.stop(node)
            return found


class MissingObjectIsEmpty(Mutant):
    breaks = ("FieldbusDriver.read_object/errors", "ignored")
    found_by = (
        "test_fieldbus.py::test_an_object_that_the_node_does_not_have_is_an_error_without_effect"
    )

    class Fieldbus(SimFieldbus):
        def read_object(self, bus: int, node: int, index: int, subindex: int) -> bytes:
            try:
                return super().read_object(bus, node, index, subindex)
            except OperationError:
                return bytes(4)


class RejectedWriteIsSilent(Mutant):
    breaks = ("FieldbusDriver.write_object/errors", "ignored")
    found_by = (
        "test_fieldbus.py::test_an_object_that_the_node_does_not_have_is_an_error_without_effect"
    )

    class Fieldbus(SimFieldbus):
        def write_object(self, bus: int, node: int, index: int, subindex: int, data: bytes) -> None:
            try:
                super().write_object(bus, node, index, subindex, data)
            except OperationError:
                return


class ResetsOnce(Mutant):
    breaks = ("FieldbusDriver.reset_statistics/zero", "second call")
    found_by = "test_fieldbus.py::test_lost_frames_are_counted_until_a_reset"

    class Fieldbus(SimFieldbus):
        def reset_statistics(self, bus: int) -> None:
            if not self.__dict__.get("done"):
                super().reset_statistics(bus)
            self.__dict__["done"] = self._simulation.network.packet_loss > 0 or self.__dict__.get(
                "done"
            )
            self.__dict__["done"] = True


class ResetStopsAxes(Mutant):
    breaks = ("FieldbusDriver.reset_statistics/zero", "side effect")
    found_by = "test_questions.py::test_what_does_not_concern_an_axis_leaves_it_alone"

    class Fieldbus(SimFieldbus):
        def reset_statistics(self, bus: int) -> None:
            super().reset_statistics(bus)
            with self._simulation.world.lock:
                for axis in range(self._simulation.axes):
                    self._simulation.motion.stop(axis)


class StatusOfAClosedDeviceRaises(Mutant):
    breaks = ("FieldbusDriver.status/states", "raises")
    found_by = "test_fieldbus.py::test_it_answers_in_every_state"

    class Fieldbus(SimFieldbus):
        def status(self, bus: int) -> BusStatus:
            if self._simulation.engine is ConnectionState.IDLE:
                raise NotReady("no device is open")
            return super().status(bus)


class StatusFromACache(Mutant):
    breaks = ("FieldbusDriver.status/status", "stale")
    found_by = "test_fieldbus.py::test_lost_frames_are_counted_until_a_reset"

    class Fieldbus(SimFieldbus):
        def status(self, bus: int) -> BusStatus:
            now, known = self._simulation.clock.now_ns(), self.__dict__.get("known")
            if known is None or now - known[0] > 20_000_000_000:
                known = self.__dict__["known"] = (now, super().status(bus))
            return known[1]


class StatusStopsTheLastAxis(Mutant):
    breaks = ("FieldbusDriver.status/status", "side effect")
    found_by = "test_questions.py::test_questions_change_nothing"

    class Fieldbus(SimFieldbus):
        def status(self, bus: int) -> BusStatus:
            with self._simulation.world.lock:
                self._simulation.motion.stop(self._simulation.axes - 1)
            return super().status(bus)


class RegistersOfTheLastNodeWrong(Mutant):
    breaks = ("FieldbusDriver.read_register/memory", "last axis")
    found_by = "test_fieldbus.py::test_registers_differ_from_each_other_and_between_nodes"

    class Fieldbus(SimFieldbus):
        def read_register(self, bus: int, node: int, address: int, length: int) -> bytes:
            last = len(self._simulation.network.slaves) - 1
            return super().read_register(bus, 0 if node == last else node, address, length)


class HotConnectStopsAxes(Mutant):
    breaks = ("FieldbusDriver.start_hot_connect/joins", "side effect")
    found_by = "test_questions.py::test_what_does_not_concern_an_axis_leaves_it_alone"

    class Fieldbus(SimFieldbus):
        def start_hot_connect(self, bus: int) -> None:
            super().start_hot_connect(bus)
            with self._simulation.world.lock:
                for axis in range(self._simulation.axes):
                    self._simulation.motion.stop(axis)
