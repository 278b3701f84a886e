"""Mutants: Connection life cycle and parameters."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import (
    BackendInfo,
    Capability,
    CommandMode,
    ConnectionState,
    DeviceTimeout,
    FloatArray,
    NotReady,
    ProcessImage,
    hookimpl,
)
from robotd_sim import SimAxes, SimDevice
from robotd_wmx_parameters import read_wmx_parameters


class StartsLater(Mutant):
    breaks = ("DeviceDriver.stop_communication/undoes", "late")
    found_by = "test_connection.py::test_a_start_that_times_out_is_undone"
    says = "after a start that failed"

    class Device(SimDevice):
        def start_communication(self, timeout_s: float) -> None:
            timed_out = timeout_s
            try:
                super().start_communication(timeout_s)
            except DeviceTimeout:
                timed_out = 0.0
                raise
            finally:
                self.late = timed_out == 0.0

        def stop_communication(self, timeout_s: float) -> None:
            if not self.late:
                super().stop_communication(timeout_s)


class RescalesLiveAxes(Mutant):
    breaks = ("DeviceDriver.load_parameters/live", "ignored")
    found_by = "test_connection.py::test_a_load_changes_no_scale_of_a_live_axis"
    says = "DID NOT RAISE"

    class Device(SimDevice):
        def load_parameters(self, path: Path) -> str:
            parameters = read_wmx_parameters(path, self.simulation.axes)
            with self.simulation.world.lock:
                self.simulation.apply(parameters)
            return ""


class DefaultsForAbsentAxes(Mutant):
    breaks = ("DeviceDriver.load_parameters/wrong-file", "ignored")
    found_by = "test_parameters.py::test_a_file_without_axes_of_the_robot_changes_no_axis"
    says = "DID NOT RAISE"

    class Device(SimDevice):
        def load_parameters(self, path: Path) -> str:
            parameters = read_wmx_parameters(path)
            with self.simulation.world.lock:
                self.simulation.load(parameters)
            return ""


class StateThatLies(Mutant):
    breaks = ("DeviceDriver.state/now", "wrong value")
    found_by = "test_connection.py::test_the_states_follow_the_calls"
    says = "RUNNING"

    class Device(SimDevice):
        def state(self) -> ConnectionState:
            state = super().state()
            return ConnectionState.COMMUNICATING if state is ConnectionState.RUNNING else state


class ParametersIgnored(Mutant):
    breaks = ("DeviceDriver.load_parameters/applies", "ignored")
    found_by = "test_connection.py::test_a_good_parameter_file_is_in_force_axis_by_axis"

    class Device(SimDevice):
        def load_parameters(self, path: Path) -> str:
            read_wmx_parameters(path)
            return ""


class DumpOfAxisZero(Mutant):
    breaks = ("DeviceDriver.dump_parameters/text", "wrong axis")
    found_by = "test_connection.py::test_a_good_parameter_file_is_in_force_axis_by_axis"

    class Device(SimDevice):
        def dump_parameters(self, axis: int) -> str:
            return super().dump_parameters(0)


class ParametersOfTheFirstAxisOnly(Mutant):
    breaks = ("DeviceDriver.load_parameters/applies", "last axis")
    found_by = "test_connection.py::test_a_good_parameter_file_is_in_force_axis_by_axis"

    class Device(SimDevice):
        def load_parameters(self, path: Path) -> str:
            before = {axis: self.dump_parameters(axis) for axis in range(self.simulation.axes)}
            note = super().load_parameters(path)
            self.__dict__["before"] = before
            return note

        def dump_parameters(self, axis: int) -> str:
            old = self.__dict__.get("before", {})
            return old[axis] if axis in old and axis > 0 else super().dump_parameters(axis)


class ParametersShownButNotInForce(Mutant):
    breaks = ("DeviceDriver.load_parameters/applies", "wrong value")
    found_by = "test_connection.py::test_loaded_parameters_are_in_force"

    class Device(SimDevice):
        def load_parameters(self, path: Path) -> str:
            self.__dict__["shown"] = read_wmx_parameters(path, self.simulation.axes)
            return ""

        def dump_parameters(self, axis: int) -> str:
            parameters = self.__dict__.get("shown", self.simulation.parameters)
            return "\n".join(f"{key} = {value}" for key, value in parameters.axis(axis).items())


class DeclaresTorqueMode(Mutant):
    breaks = ("AxisDriver.stream_torque/torque", "ignored")
    found_by = "test_torque.py::test_a_torque_moves_a_joint_until_its_source_is_lost"

    class Axes(SimAxes):
        def stream_torque(self, torque: FloatArray, due_ns: int) -> None:
            pass

    @hookimpl
    def robotd_backend(self) -> BackendInfo:
        info = super().robotd_backend()
        return replace(info, capabilities=info.capabilities | {Capability.TORQUE_MODE})


class VelocityModeIgnored(Mutant):
    breaks = ("AxisDriver.set_command_mode/changes", "ignored")
    found_by = "test_neighbours.py::test_the_mode_of_one_axis"

    class Axes(SimAxes):
        def set_command_mode(self, axis: int, mode: CommandMode) -> None:
            pass


class HomingDoesNothing(Mutant):
    breaks = ("AxisDriver.home/zero", "ignored")
    found_by = "test_units.py::test_homing_makes_the_position_zero_and_moves_nothing"

    class Axes(SimAxes):
        def home(self, axis: int, timeout_s: float) -> None:
            self._states.home_done[axis] = True


class StopsCommunicatingOnly(Mutant):
    """Servos stay on without communication."""

    breaks = ("DeviceDriver.stop_communication/axes-stop", "after re-open")
    found_by = "test_connection.py::test_servos_are_off_after_communication_stopped"

    class Device(SimDevice):
        def stop_communication(self, timeout_s: float) -> None:
            on = self.simulation.states.servo_on.copy()
            super().stop_communication(timeout_s)
            self.__dict__["on"] = on

        def start_communication(self, timeout_s: float) -> None:
            super().start_communication(timeout_s)
            with self.simulation.world.lock:
                for axis in np.flatnonzero(self.__dict__.get("on", [])):
                    self.simulation.power.request(int(axis), on=True)


class _LateFirstPosition(SimAxes):
    """Axes whose measured positions come some periods after communication has started."""

    PERIODS = 5

    def read(self, image: ProcessImage) -> None:
        known = bool(np.isfinite(image.position).all())  # else: the first period
        super().read(image)
        left = self.__dict__.get("left", 0) if known else self.PERIODS
        if left:
            image.position[:] = self.not_measured(image)
            self._readout._image = None
        else:
            self.__dict__["last"] = image.position.copy()
        self.__dict__["left"] = max(0, left - 1)

    def not_measured(self, image: ProcessImage) -> FloatArray:
        return np.zeros(image.axes)


class ReadyBeforeItsFirstPosition(Mutant):
    """Positions are 0 until the device has sent them."""

    breaks = ("AxisDriver.read/measured", "wrong value")
    found_by = "test_connection.py::test_the_first_position_of_a_connection_is_measured"
    robot = "cr3a"  # whose encoders are absolute

    class Axes(_LateFirstPosition):
        pass


class PositionsOfTheConnectionBefore(Mutant):
    breaks = ("AxisDriver.read/measured", "stale")
    found_by = "test_connection.py::test_the_first_position_of_a_connection_is_measured"

    class Axes(_LateFirstPosition):
        def not_measured(self, image: ProcessImage) -> FloatArray:
            return self.__dict__.get("last", image.position)


class CannotBeOpenedTwice(Mutant):
    breaks = ("DeviceDriver.open/connects", "after re-open")
    found_by = "test_connection.py::test_it_works_again_after_it_was_closed"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            if self.__dict__.setdefault("opened", False):
                raise NotReady("port is busy")
            self.__dict__["opened"] = True
            super().open(path, name)
