"""Mutants: Enabling, streaming and the watchdog."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import (
    FloatArray,
    ProcessImage,
    Profile,
    Underrun,
)
from robotd_servo_model.world import FOREVER
from robotd_sim import SimAxes, SimDevice


class SaysItStands(Mutant):
    breaks = ("AxisDriver.underrun/underrun", "wrong value")
    found_by = "test_underrun.py::test_an_axis_without_setpoints_does_what_underrun_says"

    class Axes(SimAxes):
        @property
        def underrun(self) -> Underrun:
            return Underrun.HOLD


class JumpAtEnable(Mutant):
    """The position command of before the servo went off is in force again."""

    breaks = ("AxisDriver.servo/no-jump", "ignored")
    found_by = "test_enable.py::test_enabling_after_a_move_by_hand_does_not_jump"
    says = "start"

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            was_on = bool(self._states.servo_on[axis])
            if was_on and not on:
                old = self.__dict__.setdefault("old", {})
                old[axis] = float(self._simulation.servo.command[axis])
            super().servo(axis, on, timeout_s)
            if on and not was_on and axis in self.__dict__.get("old", {}):
                self.move(axis, self.__dict__["old"][axis], Profile(3.0, 30.0, 30.0))


class ServoThatLies(Mutant):
    breaks = ("AxisDriver.servo/waits", "late")
    found_by = "test_enable.py::test_servo_returns_when_the_drive_says_so"
    says = "servo_on"

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            with self._world.lock:
                self._world.advance()
                late = self._world.tick + 200
                power = self._simulation.power
                self._world.at(late, lambda: power.request(axis, on=on))


class EnablesByItself(Mutant):
    breaks = ("DeviceDriver.start_communication/nothing-moves", "side effect")
    found_by = "test_connection.py::test_starting_enables_and_moves_nothing"
    says = "servo"

    class Device(SimDevice):
        def start_communication(self, timeout_s: float) -> None:
            super().start_communication(timeout_s)
            with self.simulation.world.lock:
                for axis in range(self.simulation.axes):
                    self.simulation.power.request(axis, on=True)


class SpringsBack(Mutant):
    """After a stream an axis goes back to where the stream began."""

    breaks = ("AxisDriver.end_stream/holds", "side effect")
    found_by = "test_trajectories.py::test_a_trajectory_arrives"
    says = "position"

    class Axes(SimAxes):
        def begin_stream(self, axes: Sequence[int]) -> None:
            self.__dict__["old"] = self._simulation.servo.command.copy()
            super().begin_stream(axes)

        def end_stream(self, axes: Sequence[int]) -> None:
            super().end_stream(axes)
            for axis in axes:
                self.move(axis, float(self.__dict__["old"][axis]), Profile(0.5, 5.0, 5.0))


class NoWatchdog(Mutant):
    breaks = ("backend/watchdog", "ignored")
    found_by = "test_watchdog.py::test_an_axis_stops_when_setpoints_stay_away"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            self._motion.stream._called = self._world.tick
            self._motion.stream._hold_at = float(FOREVER)
            super().read(image)


class ServoOffIgnored(Mutant):
    breaks = ("AxisDriver.servo/switches", "ignored")
    found_by = "test_enable.py::test_enabling_after_a_move_by_hand_does_not_jump"

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            if on:
                super().servo(axis, on, timeout_s)


class ServoOffSwitchesTheNext(Mutant):
    breaks = ("AxisDriver.servo/switches", "wrong axis")
    found_by = "test_enable.py::test_only_the_named_servo_is_switched"

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            super().servo(axis, on, timeout_s)
            if not on:
                super().servo((axis + 1) % self._simulation.axes, on, timeout_s)


class StreamOfAllAxes(Mutant):
    """Setpoints reach axes that do not stream."""

    breaks = ("AxisDriver.stream/others", "wrong axis")
    found_by = "test_units.py::test_a_stream_moves_its_own_axes_alone"

    class Axes(SimAxes):
        def begin_stream(self, axes: Sequence[int]) -> None:
            super().begin_stream(range(self._simulation.axes))


class StreamEndsByItself(Mutant):
    breaks = ("AxisDriver.begin_stream/operation", "wrong value")
    found_by = "test_trajectories.py::test_a_trajectory_arrives"

    class Axes(SimAxes):
        def begin_stream(self, axes: Sequence[int]) -> None:
            super().begin_stream(axes)
            for axis in axes:
                self._world.at(self._world.tick + 400, partial(self._motion.end_stream, axis))


class StreamOnePeriodLate(Mutant):
    breaks = ("AxisDriver.stream/setpoint", "late")
    found_by = "test_streams.py::test_a_setpoint_is_reached_when_it_is_due"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            before, speeds = self.__dict__.get("before", (position.copy(), velocity.copy()))
            self.__dict__["before"] = position.copy(), velocity.copy()
            super().stream(before, speeds, due_ns)
