"""Mutants: an open device that is opened or started again, and images that do not last."""

from __future__ import annotations

from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import CommandMode, ConnectionState, NotReady
from robotd_sim import SimDevice, SimIo

STATES = "test_open_again.py::test_a_device_that_is_open_keeps_alarm_mode_and_counters"
OUTPUTS = "test_open_again.py::test_a_device_that_is_open_keeps_its_outputs"


class OpenAgainSetsThePositionMode(Mutant):
    breaks = ("DeviceDriver.open/again", "side effect")
    found_by = STATES
    says = r"open\(\) changes mode"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            states = self.simulation.states
            states.mode[:] = states.mode_feedback[:] = CommandMode.POSITION


class OpenAgainClearsAlarms(Mutant):
    breaks = ("DeviceDriver.open/again", "side effect")
    found_by = STATES
    says = r"open\(\) changes"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            with self.simulation.world.lock:
                for axis in range(self.simulation.axes):
                    self.simulation.power.clear(axis)


class OpenAgainWritesTheFirstOutputs(Mutant):
    breaks = ("DeviceDriver.open/again", "side effect")
    found_by = OUTPUTS
    says = r"open\(\) changes outputs"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            outputs = self.simulation.io.outputs
            outputs[:] = self.__dict__.setdefault("first", bytes(outputs))


class StartAgainSwitchesOutputsOff(Mutant):
    breaks = ("DeviceDriver.start_communication/again", "side effect")
    found_by = OUTPUTS
    says = r"start_communication\(\) changes outputs"

    class Device(SimDevice):
        def start_communication(self, timeout_s: float) -> None:
            super().start_communication(timeout_s)
            self.simulation.io.outputs[:] = bytes(len(self.simulation.io.outputs))


class StartAgainResetsCounters(Mutant):
    breaks = ("DeviceDriver.start_communication/again", "side effect")
    found_by = STATES
    says = "resets the counters"

    class Device(SimDevice):
        def start_communication(self, timeout_s: float) -> None:
            super().start_communication(timeout_s)
            self.simulation.network.packet_loss = 0


class StartAgainStopsJogs(Mutant):
    breaks = ("DeviceDriver.start_communication/again", "side effect")
    found_by = "test_open_again.py::test_a_device_that_is_open_goes_on_with_all_commands"
    says = r"start_communication\(\): velocity"

    class Device(SimDevice):
        def start_communication(self, timeout_s: float) -> None:
            super().start_communication(timeout_s)
            with self.simulation.world.lock:
                self.simulation.motion.stop(0)


class StartAgainRaises(Mutant):
    breaks = ("DeviceDriver.start_communication/again", "raises")
    found_by = "test_open_again.py::test_a_device_that_is_open_goes_on_with_all_commands"
    says = "it communicates"

    class Device(SimDevice):
        def start_communication(self, timeout_s: float) -> None:
            if self.state() is ConnectionState.COMMUNICATING:
                raise NotReady("it communicates already")
            super().start_communication(timeout_s)


class LiveImagesOfTheConnection(Mutant):
    breaks = ("IoDriver.live/same", "after re-open")
    found_by = "test_open_again.py::test_the_live_images_are_the_same_for_ever"
    says = "the live image shows"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            if self.state() is ConnectionState.IDLE:
                io = self.simulation.io
                io.inputs, io.outputs = bytearray(len(io.inputs)), bytearray(len(io.outputs))
            super().open(path, name)


class NoReadWithoutCommunication(Mutant):
    breaks = ("IoDriver/reads", "raises")
    found_by = "test_open_again.py::test_io_answers_in_every_state"
    says = "not communicating"

    class Io(SimIo):
        def read_inputs(self, byte: int, length: int) -> bytes:
            if not self._simulation.communicating:
                raise NotReady("not communicating")
            return super().read_inputs(byte, length)
