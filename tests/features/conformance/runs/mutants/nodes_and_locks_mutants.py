"""Mutants: objects and registers that are old or out of order, lost nodes, and locks."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from dataclasses import replace

from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import BusState, BusStatus, OperationError, Profile
from robotd_sim import SimAxes, SimDevice, SimFieldbus

LOST = "test_lost_nodes.py::test_a_lost_node_is_not_operational_and_says_why"
HELD = "test_locks.py::test_no_call_holds_up_the_control_loop"
AT_ONCE = "test_locks.py::test_what_returns_at_once_waits_for_no_servo"
HOLDS_S = 0.012
SLOW_SERVO_S = 0.03  # more than a busy computer delays a thread by


class ObjectsOfTheLastSecond(Mutant):
    breaks = ("FieldbusDriver.read_object/now", "stale")
    found_by = (
        "test_bus_objects.py::test_a_statusword_shows_whether_its_axis_is_on",
        "test_bus_objects.py::test_a_position_object_follows_its_axis",
    )
    says = "statuswords|0x6064"

    class Fieldbus(SimFieldbus):
        def read_object(self, bus: int, node: int, index: int, subindex: int) -> bytes:
            known, now_ns = self.__dict__.setdefault("known", {}), self._simulation.clock.now_ns()
            key = bus, node, index, subindex
            if key not in known or now_ns - known[key][0] > 1_000_000_000:
                known[key] = now_ns, super().read_object(*key)
            return bytes(known[key][1])


class PositionsBigEndian(Mutant):
    breaks = ("FieldbusDriver.read_object/now", "wrong value")
    found_by = "test_bus_objects.py::test_a_position_object_follows_its_axis"
    says = "not as its axis"

    class Fieldbus(SimFieldbus):
        def read_object(self, bus: int, node: int, index: int, subindex: int) -> bytes:
            data = super().read_object(bus, node, index, subindex)
            return data[::-1] if index == 0x6064 else data


class StatuswordOfTheFirstDrive(Mutant):
    breaks = ("FieldbusDriver.read_object/value", "wrong axis")
    found_by = "test_bus_objects.py::test_a_statusword_shows_whether_its_axis_is_on"
    says = "statuswords"

    class Fieldbus(SimFieldbus):
        def read_object(self, bus: int, node: int, index: int, subindex: int) -> bytes:
            return super().read_object(bus, 0 if index == 0x6041 else node, index, subindex)


class ErrorOfTheFirstAlarm(Mutant):
    breaks = ("FieldbusDriver.read_object/value", "stale")
    found_by = "test_bus_objects.py::test_an_error_object_has_the_code_of_the_alarm"
    says = "0x603F is"

    class Fieldbus(SimFieldbus):
        def read_object(self, bus: int, node: int, index: int, subindex: int) -> bytes:
            data = super().read_object(bus, node, index, subindex)
            if index != 0x603F or not any(data):
                return data
            return bytes(self.__dict__.setdefault("codes", {}).setdefault(node, data))


class MissingSubindexIsTheFirst(Mutant):
    breaks = ("FieldbusDriver.read_object/errors", "ignored")
    found_by = "test_bus_objects.py::test_a_missing_subindex_and_a_constant_are_errors_each_time"
    says = "DID NOT RAISE"

    class Fieldbus(SimFieldbus):
        def read_object(self, bus: int, node: int, index: int, subindex: int) -> bytes:
            return super().read_object(bus, node, index, 0 if subindex > 4 else subindex)


class ConstantsAreWrittenSilently(Mutant):
    breaks = ("FieldbusDriver.write_object/errors", "ignored")
    found_by = "test_bus_objects.py::test_a_missing_subindex_and_a_constant_are_errors_each_time"
    says = "DID NOT RAISE"

    class Fieldbus(SimFieldbus):
        def write_object(self, bus: int, node: int, index: int, subindex: int, data: bytes) -> None:
            if index >= 0x2000:
                super().write_object(bus, node, index, subindex, data)


class LostNodeAnswersFromMemory(Mutant):
    breaks = ("FieldbusDriver.read_object/errors", "stale")
    found_by = LOST
    says = "DID NOT RAISE"

    class Fieldbus(SimFieldbus):
        def read_object(self, bus: int, node: int, index: int, subindex: int) -> bytes:
            try:
                return super().read_object(bus, node, index, subindex)
            except OperationError as error:
                if "does not answer" in str(error):
                    return bytes(4)
                raise


class LostNodeWithoutAFault(Mutant):
    breaks = ("FieldbusDriver.status/offline", "wrong value")
    found_by = LOST
    says = "offline without a fault"

    class Fieldbus(SimFieldbus):
        def status(self, bus: int) -> BusStatus:
            status = super().status(bus)
            nodes = tuple(replace(node, fault="", error_code=0) for node in status.nodes)
            return replace(status, nodes=nodes)


class LostNodeTakesTheBusAlong(Mutant):
    """Every node is shown as that of the bus, whose state is the worst of all."""

    breaks = ("FieldbusDriver.status/status", "wrong axis")
    found_by = LOST
    says = "shown as faulty, too"

    class Fieldbus(SimFieldbus):
        def status(self, bus: int) -> BusStatus:
            status = super().status(bus)
            if not any(node.offline for node in status.nodes):
                return status
            nodes = tuple(replace(node, state=BusState.UNKNOWN) for node in status.nodes)
            return replace(status, nodes=nodes)


class RegistersByPairs(Mutant):
    """An odd number of bytes begins one byte too early, except at the start."""

    breaks = ("FieldbusDriver.read_register/memory", "wrong value")
    found_by = "test_bus_objects.py::test_registers_are_the_same_in_parts_of_all_sizes"
    says = "bytes from|byte by byte"

    class Fieldbus(SimFieldbus):
        def read_register(self, bus: int, node: int, address: int, length: int) -> bytes:
            early = address - 1 if length == 3 and address > 4 else address
            return super().read_register(bus, node, early, length)


class RegistersRemembered(Mutant):
    breaks = ("FieldbusDriver.read_register/now", "stale")
    found_by = "test_bus_objects.py::test_registers_show_that_the_exchange_has_ended"
    says = "has ended"

    class Fieldbus(SimFieldbus):
        def read_register(self, bus: int, node: int, address: int, length: int) -> bytes:
            known, key = self.__dict__.setdefault("known", {}), (bus, node, address, length)
            if key not in known:
                known[key] = super().read_register(*key)
            return bytes(known[key])


class HotConnectOfTheFirstAlone(Mutant):
    breaks = ("FieldbusDriver.start_hot_connect/joins", "last axis")
    found_by = "test_lost_nodes.py::test_a_hot_connect_takes_in_all_nodes_each_time"
    says = "all drives are back"

    class Fieldbus(SimFieldbus):
        def start_hot_connect(self, bus: int) -> None:
            simulation = self._simulation
            with simulation.world.lock:
                simulation.world.advance()
                for slave in simulation.network.slaves:
                    if not slave.connected:
                        simulation._connect(slave.id, connected=True)
                        return


class HotConnectWorksOnce(Mutant):
    breaks = ("FieldbusDriver.start_hot_connect/joins", "second call")
    found_by = "test_lost_nodes.py::test_a_hot_connect_takes_in_all_nodes_each_time"
    says = "all drives are back"

    class Fieldbus(SimFieldbus):
        def start_hot_connect(self, bus: int) -> None:
            if not self.__dict__.setdefault("done", False):
                self.__dict__["done"] = True
                super().start_hot_connect(bus)


class ModeOfTheFirstDrive(Mutant):
    breaks = ("FieldbusDriver.read_object/value", "wrong axis")
    found_by = "test_bus_objects.py::test_a_mode_object_shows_the_mode_of_its_axis"
    says = "0x6061 went from"

    class Fieldbus(SimFieldbus):
        def read_object(self, bus: int, node: int, index: int, subindex: int) -> bytes:
            return super().read_object(bus, 0 if index == 0x6061 else node, index, subindex)


class TimesAreWrittenTogether(Mutant):
    """Two objects of a node that mean a time have one place."""

    breaks = ("FieldbusDriver.write_object/writes", "side effect")
    found_by = "test_bus_objects.py::test_objects_of_each_size_are_written_beside_each_other"
    says = "of node"

    class Fieldbus(SimFieldbus):
        def write_object(self, bus: int, node: int, index: int, subindex: int, data: bytes) -> None:
            super().write_object(bus, node, index, subindex, data)
            if index == 0x6066:
                super().write_object(bus, node, 0x6068, subindex, data)


class AnswersShareABuffer(Mutant):
    breaks = ("drivers/threads", "wrong value")
    found_by = "test_bus_objects.py::test_objects_that_several_threads_read_are_not_mixed"
    says = "those of another thread"

    class Fieldbus(SimFieldbus):
        def read_object(self, bus: int, node: int, index: int, subindex: int) -> bytes:
            self.__dict__["answer"] = super().read_object(bus, node, index, subindex)
            time.sleep(0.001)
            return bytes(self.__dict__["answer"])


class ScanKeepsTheLost(Mutant):
    breaks = ("DeviceDriver.scan_network/summary", "stale")
    found_by = "test_lost_nodes.py::test_a_hot_connect_takes_in_all_nodes_each_time"
    says = "as lost that are back"

    class Device(SimDevice):
        def scan_network(self) -> str:
            text = super().scan_network()
            if "no answer" in text:
                self.__dict__["lost"] = text
            return str(self.__dict__.get("lost", text))


class FaultIsToldOnce(Mutant):
    breaks = ("DeviceDriver.fault/reason", "second call")
    found_by = "test_ageing.py::test_each_silence_has_its_reason"
    says = "the second time"

    class Device(SimDevice):
        def fault(self) -> str:
            text = super().fault()
            told = self.__dict__.setdefault("told", 0)
            if text and told == 0:
                self.__dict__["told"] = 1
            elif not text and told == 1:
                self.__dict__["told"] = 2
            return text if told < 2 else ""


class JogsHoldTheLock(Mutant):
    breaks = ("drivers/timeouts", "blocks")
    found_by = HELD
    says = "jog holds up the control loop"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            super().jog(axis, profile)
            with self._world.lock:
                time.sleep(HOLDS_S)


class DumpsHoldTheLock(Mutant):
    breaks = ("drivers/timeouts", "blocks")
    found_by = HELD
    says = "dump_parameters holds up the control loop"

    class Device(SimDevice):
        def dump_parameters(self, axis: int) -> str:
            with self.simulation.world.lock:
                time.sleep(HOLDS_S)
            return super().dump_parameters(axis)


class PolarityHoldsTheLock(Mutant):
    breaks = ("drivers/timeouts", "blocks")
    found_by = "test_locks.py::test_no_change_of_scale_holds_up_the_control_loop"
    says = "set_polarity holds up the control loop"

    class Axes(SimAxes):
        def set_polarity(self, axis: int, polarity: int) -> None:
            super().set_polarity(axis, polarity)
            with self._world.lock:
                time.sleep(HOLDS_S)


class StopsQueueBehindServos(Mutant):
    """One command of the device at a time, with its wait."""

    breaks = ("AxisDriver.stop/returns", "blocks")
    found_by = AT_ONCE
    says = "stop waits .* for a servo"
    one = threading.Lock()

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            with StopsQueueBehindServos.one:
                super().servo(axis, on, timeout_s)
                time.sleep(SLOW_SERVO_S)

        def stop(self, axes: Sequence[int]) -> None:
            with StopsQueueBehindServos.one:
                super().stop(axes)


class FaultQueuesBehindServos(Mutant):
    breaks = ("DeviceDriver.fault/blocks", "blocks")
    found_by = AT_ONCE
    says = "fault waits .* for a servo"
    one = threading.Lock()

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            with FaultQueuesBehindServos.one:
                super().servo(axis, on, timeout_s)
                time.sleep(SLOW_SERVO_S)

    class Device(SimDevice):
        def fault(self) -> str:
            with FaultQueuesBehindServos.one:
                return super().fault()
