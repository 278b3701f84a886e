"""Mutants: Device, I/O and fieldbus, written before any check was run on them."""

from __future__ import annotations

import logging
import os
import sys
import time
import warnings
from dataclasses import replace

import numpy as np
from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import BusStatus, ConnectionState, NotReady
from robotd_sim import SimDevice, SimFaultInjector, SimFieldbus, SimIo


class FaultStays(Mutant):
    breaks = ("DeviceDriver.fault/reason", "stale")
    found_by = "test_ageing.py::test_the_device_says_at_once_why_it_is_silent"

    class Device(SimDevice):
        def fault(self) -> str:
            text = super().fault() or self.__dict__.get("kept", "")
            self.__dict__["kept"] = text
            return str(text)


class FaultOfTwoLines(Mutant):
    breaks = ("DeviceDriver.fault/reason", "wrong value")
    found_by = "test_ageing.py::test_the_device_says_at_once_why_it_is_silent"

    class Device(SimDevice):
        def fault(self) -> str:
            text = super().fault()
            return text and f"{text}\nsee the manual"


class StateBlocksNowAndThen(Mutant):
    breaks = ("DeviceDriver.state/blocks", "blocks")
    found_by = "test_cost.py::test_state_does_not_block"

    class Device(SimDevice):
        def state(self) -> ConnectionState:
            count = self.__dict__["count"] = int(self.__dict__.get("count", 0)) + 1
            if count % 40 == 0:
                time.sleep(0.01)
            return super().state()


class StateIsUnknownAtFirst(Mutant):
    breaks = ("DeviceDriver.state/now", "wrong value")
    found_by = "test_connection.py::test_a_device_that_is_made_is_idle"

    class Device(SimDevice):
        def state(self) -> ConnectionState:
            state = super().state()
            return ConnectionState.UNKNOWN if state is ConnectionState.IDLE else state


class ScanRaisesInOperation(Mutant):
    breaks = ("DeviceDriver.scan_network/summary", "wrong value")
    found_by = "test_fieldbus.py::test_a_lost_drive_is_missing_in_a_scan"

    class Device(SimDevice):
        def scan_network(self) -> str:
            if self.simulation.communicating:
                raise NotReady("the bus is in use")
            return super().scan_network()


class DumpOfTheLastIsTheFirst(Mutant):
    breaks = ("DeviceDriver.dump_parameters/text", "wrong axis")
    found_by = "test_connection.py::test_loaded_parameters_are_in_force"

    class Device(SimDevice):
        def dump_parameters(self, axis: int) -> str:
            return super().dump_parameters(0 if axis == self.simulation.axes - 1 else axis)


class LastAxisTurnsAtTheSecondStart(Mutant):
    breaks = ("DeviceDriver.start_communication/starts", "second call")
    found_by = "test_connection.py::test_the_first_position_of_a_connection_is_measured"

    class Device(SimDevice):
        def start_communication(self, timeout_s: float) -> None:
            super().start_communication(timeout_s)
            starts = self.__dict__["starts"] = int(self.__dict__.get("starts", 0)) + 1
            if starts > 1:
                with self.simulation.world.lock:
                    axis = self.simulation.axes - 1
                    self.simulation.servo.place(axis, 0.0, 0.0, 0.0)
                    self.simulation.motion.hold(axis, 0.05)


class StartRaisesAfterALostLink(Mutant):
    breaks = ("DeviceDriver.start_communication/resumes", "ignored")
    found_by = "test_reopening.py::test_a_lost_link_is_shown_and_resumed"

    class Injector(SimFaultInjector):
        def drop_communication(self) -> None:
            super().drop_communication()
            self._simulation.__dict__["dropped"] = True

    class Device(SimDevice):
        def start_communication(self, timeout_s: float) -> None:
            if self.simulation.__dict__.get("dropped"):
                raise NotReady("open the device again")
            super().start_communication(timeout_s)

        def close(self) -> None:
            self.simulation.__dict__["dropped"] = False
            super().close()


class CloseRaisesInMotion(Mutant):
    breaks = ("DeviceDriver.close/disconnects", "raises")
    found_by = "test_reopening.py::test_a_command_does_not_outlive_its_connection"

    class Device(SimDevice):
        def close(self) -> None:
            simulation = self.simulation
            moving = any(simulation.world.moves(axis) for axis in range(simulation.axes))
            super().close()
            if moving:
                raise NotReady("an axis moves")


class StopLeavesHandles(Mutant):
    breaks = ("DeviceDriver.stop_communication/ends", "leaks")
    found_by = "test_leaks.py::test_nothing_grows_with_each_start"

    class Device(SimDevice):
        def stop_communication(self, timeout_s: float) -> None:
            super().stop_communication(timeout_s)
            os.open(os.devnull, os.O_RDONLY)


class OpenTakesPrivileges(Mutant):
    breaks = ("backend/process", "side effect")
    found_by = "test_process.py::test_it_is_left_as_it_is"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            sys.setrecursionlimit(sys.getrecursionlimit() + 500)


class SilencesWarnings(Mutant):
    breaks = ("backend/process", "side effect")
    found_by = "test_process.py::test_it_is_left_as_it_is"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            warnings.simplefilter("ignore")


class DisablesLogs(Mutant):
    breaks = ("backend/process", "side effect")
    found_by = "test_process.py::test_it_is_left_as_it_is"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            logging.disable(logging.WARNING)


class ChangesTheFolderWhenClosed(Mutant):
    breaks = ("backend/process", "side effect")
    found_by = "test_process.py::test_it_is_left_as_it_is"

    class Device(SimDevice):
        def close(self) -> None:
            super().close()
            os.environ["ACME_CLOSED"] = "1"


class BitClearsTheNextByte(Mutant):
    breaks = ("IoDriver.write_output_bit/bit", "side effect")
    found_by = "test_io.py::test_a_bit_leaves_its_neighbours_alone"

    class Io(SimIo):
        def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
            super().write_output_bit(byte, bit, value)
            if byte + 1 < self.output_bytes:
                self.write_outputs(byte + 1, b"\x00")


class BitSevenIsASign(Mutant):
    breaks = ("IoDriver.write_output_bit/bit", "wrong value")
    found_by = "test_io.py::test_a_bit_leaves_its_neighbours_alone"

    class Io(SimIo):
        def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
            super().write_output_bit(byte, bit, value)
            if bit == 7 and value:
                self.write_outputs(byte, b"\x80")


class LongWritesReversed(Mutant):
    breaks = ("IoDriver.write_outputs/bytes", "wrong value")
    found_by = "test_io.py::test_each_output_byte_is_at_its_address"

    class Io(SimIo):
        def write_outputs(self, byte: int, data: bytes) -> None:
            super().write_outputs(byte, data[::-1])


class InputsASecondLate(Mutant):
    breaks = ("IoDriver.read_inputs/bytes", "stale")
    found_by = "test_io.py::test_each_input_is_at_its_address"

    class Io(SimIo):
        def read_inputs(self, byte: int, length: int) -> bytes:
            now, known = self._simulation.clock.now_ns(), self.__dict__.get("known")
            if known is None or now - known[0] > 3_000_000_000:
                known = self.__dict__["known"] = now, super().read_inputs(0, self.input_bytes)
            return bytes(known[1][byte : byte + length])


class SecondInputByteInverted(Mutant):
    breaks = ("IoDriver.read_inputs/bytes", "wrong value")
    found_by = "test_io.py::test_each_input_is_at_its_address"

    class Io(SimIo):
        def read_inputs(self, byte: int, length: int) -> bytes:
            whole = bytearray(super().read_inputs(0, self.input_bytes))
            whole[1] ^= 0xFF
            return bytes(whole[byte : byte + length])


class LiveOutputsAreInputs(Mutant):
    breaks = ("IoDriver.live/images", "wrong value")
    found_by = "test_io.py::test_each_output_byte_is_at_its_address"

    class Io(SimIo):
        @property
        def live(self) -> tuple[memoryview, memoryview]:
            inputs, _ = super().live
            return inputs, inputs


class ReadOutputsOfTheLastWrite(Mutant):
    """A bit that is written is not shown by ``read_outputs``."""

    breaks = ("IoDriver.read_outputs/bytes", "stale")
    found_by = "test_io.py::test_a_bit_leaves_its_neighbours_alone"

    class Io(SimIo):
        def read_outputs(self, byte: int, length: int) -> bytes:
            shadow = self.__dict__.setdefault("shadow", {})
            return bytes(
                shadow.get(at, value)
                for at, value in enumerate(super().read_outputs(byte, length), byte)
            )

        def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
            before = self.read_outputs(byte, 1)[0]
            super().write_output_bit(byte, bit, value)
            self.__dict__.setdefault("shadow", {})[byte] = before


class PeriodInMilliseconds(Mutant):
    breaks = ("FieldbusDriver.status/status", "wrong value")
    found_by = "test_fieldbus.py::test_the_nodes_have_as_many_axes_as_the_bus"

    class Fieldbus(SimFieldbus):
        def status(self, bus: int) -> BusStatus:
            found = super().status(bus)
            return replace(found, period_s=1e3 * found.period_s)


class SerialsAllTheSame(Mutant):
    breaks = ("FieldbusDriver.status/status", "wrong value")
    found_by = "test_fieldbus.py::test_objects_are_those_of_the_status"

    class Fieldbus(SimFieldbus):
        def status(self, bus: int) -> BusStatus:
            found = super().status(bus)
            return replace(found, nodes=tuple(replace(node, serial=1) for node in found.nodes))


class ObjectsBigEndian(Mutant):
    breaks = ("FieldbusDriver.read_object/value", "wrong value")
    found_by = "test_fieldbus.py::test_a_written_object_is_in_its_node"

    class Fieldbus(SimFieldbus):
        def read_object(self, bus: int, node: int, index: int, subindex: int) -> bytes:
            return super().read_object(bus, node, index, subindex)[::-1]


class WritesTheLowByteOnly(Mutant):
    breaks = ("FieldbusDriver.write_object/writes", "wrong value")
    found_by = "test_fieldbus.py::test_a_written_object_is_in_its_node"

    class Fieldbus(SimFieldbus):
        def write_object(self, bus: int, node: int, index: int, subindex: int, data: bytes) -> None:
            kept = self.read_object(bus, node, index, subindex)
            super().write_object(bus, node, index, subindex, data[:1] + kept[1:])


class LastNodeIsNotWritten(Mutant):
    breaks = ("FieldbusDriver.write_object/writes", "last axis")
    found_by = "test_fieldbus.py::test_a_written_object_is_in_its_node"

    class Fieldbus(SimFieldbus):
        def write_object(self, bus: int, node: int, index: int, subindex: int, data: bytes) -> None:
            last = len(self._simulation.network.slaves) - 1
            if node != last or index == 0x0FFF:
                super().write_object(bus, node, index, subindex, data)


class RegistersOneFurther(Mutant):
    breaks = ("FieldbusDriver.read_register/memory", "wrong value")
    found_by = "test_fieldbus.py::test_registers_have_the_length_that_was_asked_for"

    class Fieldbus(SimFieldbus):
        def read_register(self, bus: int, node: int, address: int, length: int) -> bytes:
            return super().read_register(bus, node, address + (address > 0), length)


class LostFramesTwice(Mutant):
    breaks = ("FieldbusDriver.status/status", "wrong value")
    found_by = "test_fieldbus.py::test_counters_count_again_after_a_reset"

    class Fieldbus(SimFieldbus):
        def status(self, bus: int) -> BusStatus:
            found = super().status(bus)
            return replace(found, lost_frames=10 * found.lost_frames)


class HotConnectForgetsTheLast(Mutant):
    breaks = ("FieldbusDriver.start_hot_connect/joins", "ignored")
    found_by = "test_faults.py::test_a_drive_that_is_back_stays_off"

    class Fieldbus(SimFieldbus):
        def start_hot_connect(self, bus: int) -> None:
            if self._simulation.states.connected[-1]:
                super().start_hot_connect(bus)


class NodeIdsOfTheStart(Mutant):
    breaks = ("FieldbusDriver.node_ids/ids", "wrong value")
    found_by = "test_fieldbus.py::test_the_slaves_are_told_apart"

    class Fieldbus(SimFieldbus):
        def node_ids(self, bus: int) -> list[int]:
            return [node.id for node in self.status(bus).nodes][:-1]


class SizesOfTheInputs(Mutant):
    breaks = ("IoDriver.output_bytes/size", "wrong value")
    found_by = "test_io.py::test_the_images_have_a_size"

    class Io(SimIo):
        @property
        def output_bytes(self) -> int:
            return 2 * super().output_bytes


class RegisterSizeOfZero(Mutant):
    breaks = ("FieldbusDriver.register_bytes/size", "wrong value")
    found_by = "test_fieldbus.py::test_registers_have_the_length_that_was_asked_for"

    class Fieldbus(SimFieldbus):
        @property
        def register_bytes(self) -> int:
            return 4 * super().register_bytes


class MemoryWithEachAnswer(Mutant):
    breaks = ("DeviceDriver.state/now", "side effect")
    found_by = "test_process.py::test_reading_needs_no_memory"

    class Device(SimDevice):
        def state(self) -> ConnectionState:
            self.__dict__.setdefault("answers", []).append(np.zeros(50))
            return super().state()
