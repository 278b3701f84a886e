"""Mutants: faults that the later sets of other authors had and no check found."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np
from tests.features.conformance.runs.mutants.plugin import Mutant, ReadAnew

from robotd.api import (
    BusStatus,
    CommandMode,
    ConnectionState,
    DescriptorError,
    DeviceContext,
    DeviceDriver,
    DeviceTimeout,
    FloatArray,
    LateSetpoint,
    NotReady,
    Operation,
    OperationError,
    ProcessImage,
    Profile,
    hookimpl,
)
from robotd_sim import (
    SimAxes,
    SimDevice,
    SimFieldbus,
    SimIo,
    SimOptions,
    Simulation,
)
from robotd_wmx_parameters import read_wmx_parameters


class FlagsAreWrittenWhenTheyChange(Mutant):
    breaks = ("AxisDriver.read/fills", "stale")
    found_by = "test_cost.py::test_a_second_image_is_filled_as_the_first"
    says = "not filled in another image: .*mode"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            kept = image.home_done.copy(), image.mode.copy()
            super().read(image)
            now = image.home_done.tobytes() + image.mode.tobytes()
            if now == self.__dict__.get("now"):
                image.home_done[:], image.mode[:] = kept
            self.__dict__["now"] = now


class ServoReturnsAfterItsTime(Mutant):
    breaks = ("AxisDriver.servo/waits", "late")
    found_by = "test_enable.py::test_what_takes_too_long_is_a_time_out"
    says = "before it is done"

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            with suppress(DeviceTimeout):
                super().servo(axis, on, timeout_s)


class MoveWaitsForItsDrive(Mutant):
    """Makes the move that a lost drive has not finished when its servo is on again."""

    breaks = ("AxisDriver/resumption", "side effect")
    found_by = "test_resumption.py::test_nothing_moves_after_a_new_connection"
    says = "without a command"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            lost = self.__dict__.setdefault("lost", set())
            lost.update(np.flatnonzero(~self._states.connected).tolist())

        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, profile)
            self.__dict__.setdefault("moves", {})[axis] = target, profile

        def stop(self, axes: Sequence[int]) -> None:
            super().stop(axes)
            for axis in axes:
                self.__dict__.setdefault("moves", {}).pop(axis, None)

        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            super().servo(axis, on, timeout_s)
            move = self.__dict__.setdefault("moves", {}).pop(axis, None)
            if on and move and axis in self.__dict__.get("lost", ()):
                with self._world.lock:
                    self._motion.move(axis, *move)


class LateSetpointsAreDropped(Mutant):
    breaks = ("AxisDriver.stream/late", "ignored")
    found_by = "test_setpoints.py::test_a_setpoint_that_was_too_late_has_no_effect"
    says = "neither executed nor rejected"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            with suppress(LateSetpoint):
                super().stream(position, velocity, due_ns)


class StopsOfJogsWait(Mutant):
    """Those of moves do not."""

    breaks = ("AxisDriver.stop/returns", "blocks")
    found_by = "test_ramps.py::test_a_stop_returns_at_once"
    says = "a stop has waited"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            jogs = [axis for axis in axes if self._states.operation[axis] == Operation.VELOCITY]
            super().stop(axes)
            self._wait(lambda: not any(self._world.moves(axis) for axis in jogs), 5.0)


class RejectedBeginsEndStreams(Mutant):
    breaks = ("AxisDriver.begin_stream/again", "side effect")
    found_by = "test_axes_apart.py::test_a_stream_of_an_axis_that_is_off_begins_for_none"
    says = "after a rejected begin"

    class Axes(SimAxes):
        def begin_stream(self, axes: Sequence[int]) -> None:
            try:
                super().begin_stream(axes)
            except OperationError:
                self.end_stream(axes)
                raise


class CountersFromTheLastReset(Mutant):
    """Those of the device begin anew with communication."""

    breaks = ("FieldbusDriver.reset_statistics/zero", "side effect")
    found_by = "test_fieldbus.py::test_no_counter_is_negative_after_a_restart"
    says = "late cycles: \\(-"

    class Fieldbus(SimFieldbus):
        def status(self, bus: int) -> BusStatus:
            status = super().status(bus)
            return replace(
                status, lost_frames=status.lost_frames - int(self.__dict__.get("base", 0))
            )

        def reset_statistics(self, bus: int) -> None:
            self.__dict__["base"] = super().status(bus).lost_frames


class RejectedMovesRaiseNumbers(Mutant):
    breaks = ("drivers/errors", "raises")
    found_by = "test_enable.py::test_a_disabled_axis_refuses_to_move"
    says = "not an error of robotd"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            try:
                super().move(axis, target, profile)
            except (NotReady, OperationError):
                raise RuntimeError("error 0x1A02") from None


class StateWaitsOnceTheLinkIsLost(Mutant):
    """It asks the device, which does not answer."""

    breaks = ("DeviceDriver.state/blocks", "blocks")
    found_by = "test_reopening.py::test_a_lost_link_is_shown_and_resumed"
    says = "state has waited 0.8 s"

    class Device(SimDevice):
        def start_communication(self, timeout_s: float) -> None:
            super().start_communication(timeout_s)
            self.__dict__["communicated"] = True

        def state(self) -> ConnectionState:
            state, clock = super().state(), self.simulation.clock
            if self.__dict__.get("communicated") and state is not ConnectionState.COMMUNICATING:
                clock.sleep_until_ns(clock.now_ns() + 800_000_000)
            return state


class WrongFilesTurnAxes(Mutant):
    """The polarity is read and applied by itself, before the rest is."""

    breaks = ("DeviceDriver.load_parameters/wrong-file", "ignored")
    found_by = "test_parameters.py::test_a_wrong_value_of_the_last_axis_changes_no_axis"
    says = "a file with a wrong value"

    class Device(SimDevice):
        def load_parameters(self, path: Path) -> str:
            simulation = self.simulation
            try:
                return super().load_parameters(path)
            except DescriptorError:
                text = path.read_text(encoding="utf-8")
                found = re.findall(r"<AxisPolarity>(-?1)<", text)[: simulation.axes]
                polarity = {axis: int(value) for axis, value in enumerate(found)}
                changed = simulation.parameters.with_values({"AxisPolarity": polarity})
                with simulation.world.lock:
                    simulation.apply(changed)
                raise


class ParametersSurvive(Mutant):
    breaks = ("DeviceDriver.load_parameters/kept", "survives close")
    found_by = "test_parameters.py::test_a_file_is_in_force_until_the_device_is_closed"
    says = "closed and opened again"

    class Device(SimDevice):
        def close(self) -> None:
            simulation = self.simulation
            parameters = simulation.parameters
            super().close()
            with simulation.world.lock:
                simulation.apply(parameters)


class ClosedSwitchesSwallowCommands(Mutant):
    breaks = ("AxisDriver/as-commanded", "ignored")
    found_by = (
        "test_command_sequences.py"
        "::test_a_command_into_a_closed_limit_switch_is_made_or_says_why_not"
    )
    says = "was accepted, nothing moves"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            with suppress(OperationError):
                super().move(axis, target, profile)

        def jog(self, axis: int, profile: Profile) -> None:
            with suppress(OperationError):
                super().jog(axis, profile)


class NeverSaysWhyItIsSilent(Mutant):
    breaks = ("DeviceDriver.fault/reason", "ignored")
    found_by = "test_reopening.py::test_a_lost_link_is_shown_and_resumed"
    says = "says why the device is lost"

    class Device(SimDevice):
        def fault(self) -> str:
            return ""


class ReasonStaysUntilAnAlarmIsCleared(Mutant):
    breaks = ("AxisDriver.read/reason", "stale")
    found_by = "test_watchdog.py::test_the_reason_of_a_stop_ends_with_the_next_command"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            kept = self.__dict__.setdefault("kept", [""] * image.axes)
            for axis, reason in enumerate(image.reason):
                image.reason[axis] = kept[axis] = reason or kept[axis]

        def clear_alarm(self, axis: int, timeout_s: float) -> None:
            super().clear_alarm(axis, timeout_s)
            self.__dict__["kept"][axis] = ""


class ShortFilesAreAppliedAsFarAsTheyGo(Mutant):
    breaks = ("DeviceDriver.load_parameters/applies", "side effect")
    found_by = "test_parameters.py::test_a_file_without_axes_of_the_robot_changes_no_axis"
    says = "a file without axes"

    class Device(SimDevice):
        def load_parameters(self, path: Path) -> str:
            try:
                return super().load_parameters(path)
            except DescriptorError:
                simulation, found = self.simulation, read_wmx_parameters(path)
                stated = set(range(simulation.axes)) - {*found.absent_axes(simulation.axes)}
                values = {
                    name: {axis: column[axis].item() for axis in stated}
                    for name, column in found.columns.items()
                }
                with simulation.world.lock:
                    simulation.load(simulation.parameters.with_values(values))
                raise


class NamesOneAxisThatAFileLacks(Mutant):
    breaks = ("DeviceDriver.load_parameters/wrong-file", "last axis")
    found_by = "test_parameters.py::test_a_file_without_axes_of_the_robot_changes_no_axis"
    says = "is missing, not named"

    class Device(SimDevice):
        def load_parameters(self, path: Path) -> str:
            try:
                return super().load_parameters(path)
            except DescriptorError as error:
                if lacking := read_wmx_parameters(path).absent_axes(self.simulation.axes):
                    raise DescriptorError(f"axis {lacking[0]} is not in it", path=path) from error
                raise


class MovesBackEndTooEarly(Mutant):
    breaks = ("AxisDriver.move/target", "one direction")
    found_by = "test_extremes.py::test_a_target_is_met_from_both_sides"
    says = "missed"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            goes_back = target < self._simulation.servo.command[axis] - 0.001
            super().move(axis, target + 0.0005 * goes_back, profile)


class OneDeviceForAll(Mutant):
    breaks = ("backend/makes", "second call")
    found_by = "test_open_again.py::test_each_device_is_made_anew"
    made: ClassVar[list[SimDevice]] = []

    @hookimpl
    def robotd_open_device(self, context: DeviceContext[SimOptions]) -> DeviceDriver:
        if not self.made or self.made[0].state() is ConnectionState.IDLE:
            self.made[:] = [SimDevice(Simulation(context.robot, context.options, context.clock))]
        return self.made[0]


class OutputsThatChangeAfterwards(Mutant):
    breaks = ("IoDriver.read_outputs/bytes", "stale")
    found_by = "test_io.py::test_what_was_read_stays_as_it_was"
    says = "memoryview"

    class Io(SimIo):
        def read_outputs(self, byte: int, length: int) -> bytes:
            super().read_outputs(byte, length)  # checks the address
            return memoryview(self._simulation.io.outputs)[byte : byte + length]  # type: ignore[return-value]


class StopOfAnIdleAxisIsNotComplete(Mutant):
    breaks = ("AxisDriver.stop/idle", "side effect")
    found_by = "test_stopping.py::test_a_stop_of_a_standing_axis_has_no_effect"
    says = "motion_complete has changed"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            super().stop(axes)
            states = self._simulation.states
            for axis in axes:
                if states.operation[axis] == Operation.IDLE:
                    states.motion_complete[axis] = False


class ServosOnAgainWithTheLink(Mutant):
    breaks = ("AxisDriver/servos", "side effect")
    found_by = "test_resumption.py::test_nothing_moves_after_a_new_connection"
    says = "go on when communication has begun again"

    class Device(SimDevice):
        def __init__(self, simulation: Simulation) -> None:
            super().__init__(simulation)
            self.were_on: list[int] = []
            silence = simulation.silence

            def note() -> None:
                if simulation.lost_because and simulation.communicating:
                    self.were_on = np.flatnonzero(simulation.states.servo_on).tolist()
                silence()

            simulation.silence = note  # type: ignore[method-assign]

        def start_communication(self, timeout_s: float) -> None:
            super().start_communication(timeout_s)
            with self.simulation.world.lock:
                for axis in self.were_on:
                    self.simulation.power.request(axis, on=True)
                self.were_on = []


class TorqueModeThatIsNotThere(Mutant):
    breaks = ("AxisDriver.set_command_mode/undeclared", "ignored")
    found_by = "test_rejections.py::test_the_driver_takes_no_mode_that_is_not_declared"
    says = "DID NOT RAISE"

    class Axes(SimAxes):
        def set_command_mode(self, axis: int, mode: CommandMode) -> None:
            if mode is not CommandMode.TORQUE:
                super().set_command_mode(axis, mode)


class RejectedFileInPart(Mutant):
    """Windows of a file that the servo of another axis forbids."""

    breaks = ("DeviceDriver.load_parameters/live", "side effect")
    found_by = "test_parameters.py::test_a_load_that_one_axis_forbids_changes_no_other"
    says = "rejected for axis"

    class Device(SimDevice):
        def load_parameters(self, path: Path) -> str:
            try:
                return super().load_parameters(path)
            except NotReady:
                simulation = self.simulation
                wanted = read_wmx_parameters(path, simulation.axes)["InPosWidth"]
                widths = {axis: wanted[axis].item() for axis in range(simulation.axes)}
                with simulation.world.lock:
                    values = {"InPosWidth": widths}
                    simulation.parameters = simulation.parameters.with_values(values)
                raise
