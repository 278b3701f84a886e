"""Mutants: Stop and quick stop."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import (
    FloatArray,
    Operation,
    Profile,
)
from robotd_sim import SimAxes


class StopThatDoesNotStop(Mutant):
    breaks = ("AxisDriver.stop/starts", "ignored")
    found_by = "test_stopping.py::test_a_stop_takes_the_time_and_distance_of_its_ramp"
    says = "ramp_s"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            pass


class QuickStopThatCoasts(Mutant):
    breaks = ("AxisDriver.quick_stop/starts", "wrong value")
    found_by = "test_stopping.py::test_a_quick_stop_is_no_slower_than_a_stop"
    says = "quick"

    class Axes(SimAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            with self._world.lock:
                self._world.advance()
                for axis in axes:
                    self._motion.brake(axis, 1.0)


class StopsEverything(Mutant):
    breaks = ("AxisDriver.stop/all-axes", "wrong axis")
    found_by = "test_stopping.py::test_a_stop_leaves_other_axes_alone"
    says = "targets"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            super().stop(range(self._simulation.axes))


class StopIgnoredInStreams(Mutant):
    breaks = ("AxisDriver.stop/stream", "ignored")
    found_by = "test_ramps.py::test_a_stop_ends_a_trajectory"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            super().stop([a for a in axes if self._states.operation[a] != Operation.STREAM])


class QuickStopIgnoredInStreams(Mutant):
    breaks = ("AxisDriver.quick_stop/starts", "ignored")
    found_by = "test_ramps.py::test_a_stop_ends_a_trajectory"

    class Axes(SimAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            super().quick_stop([a for a in axes if self._states.operation[a] != Operation.STREAM])


class KeepsPushing(Mutant):
    breaks = ("AxisDriver.stream/setpoint", "ignored")
    found_by = "test_faults.py::test_a_joint_that_was_blocked_does_not_leap_when_it_is_freed"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            servo = self._simulation.servo
            away = np.abs(servo.command - servo.position) > 0.03
            command = np.where(away, servo.command, position)
            super().stream(command, np.where(away, 0.0, velocity), due_ns)


class StopWaits(Mutant):
    breaks = ("AxisDriver.stop/returns", "blocks")
    found_by = "test_ramps.py::test_a_stop_returns_at_once"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            super().stop(axes)
            self._wait(lambda: not any(self._world.moves(axis) for axis in axes), 5.0)


class QuickStopWaits(Mutant):
    breaks = ("AxisDriver.quick_stop/returns", "blocks")
    found_by = "test_ramps.py::test_a_stop_returns_at_once"

    class Axes(SimAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            super().quick_stop(axes)
            clock = self._simulation.clock
            clock.sleep_until_ns(clock.now_ns() + 30_000_000)


class StopByAcceleration(Mutant):
    breaks = ("AxisDriver.stop/ramp", "wrong value")
    found_by = "test_ramps.py::test_a_stop_has_the_ramp_of_the_move"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, profile)
            self._motion._deceleration[axis] = profile.acceleration


class StopByFixedRamp(Mutant):
    breaks = ("AxisDriver.stop/ramp", "wrong value")
    found_by = "test_ramps.py::test_a_stop_has_the_ramp_of_the_move"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, profile)
            self._motion._deceleration[axis] = 4.0


class StopByFixedRampOfJog(Mutant):
    breaks = ("AxisDriver.stop/ramp", "wrong value")
    found_by = "test_ramps.py::test_a_velocity_command_has_the_ramps_of_its_profile"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            super().jog(axis, profile)
            self._motion._deceleration[axis] = 4.0


class StopTooHard(Mutant):
    breaks = ("AxisDriver.stop/ramp", "wrong value")
    found_by = "test_ramps.py::test_a_stop_has_the_ramp_of_the_move"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            self.quick_stop(axes)


class StopOnlyTheFirst(Mutant):
    breaks = ("AxisDriver.stop/all-axes", "last axis")
    found_by = "test_stopping.py::test_a_stopped_move_is_not_complete"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            super().stop(list(axes)[:1])


class StopAndReturn(Mutant):
    breaks = ("AxisDriver.stop/rests", "side effect")
    found_by = "test_ramps.py::test_an_axis_that_is_stopped_neither_returns_nor_goes_on"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            with self._world.lock:
                self._world.advance()
                for axis in axes:
                    if self._states.operation[axis] == Operation.POSITION:
                        here = float(self._simulation.servo.command[axis])
                        back = partial(self._motion.move, axis, here, Profile(0.5, 4.0, 4.0))
                        self._motion.brake(axis, 4.0, back)


class StopAndGoOn(Mutant):
    breaks = ("AxisDriver.stop/rests", "side effect")
    found_by = "test_ramps.py::test_an_axis_that_is_stopped_neither_returns_nor_goes_on"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            super().stop(axes)
            for axis in axes:
                target = float(self._simulation.servo.command[axis]) + 0.1
                later = partial(self._motion.move, axis, target, Profile(0.3, 4.0, 4.0))
                self._world.at(self._world.tick + 800, later)


class StopIgnoredBackwards(Mutant):
    breaks = ("AxisDriver.stop/starts", "one direction")
    found_by = "test_stopping.py::test_a_stopped_move_is_not_complete"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            speed = self._simulation.servo.command_velocity
            super().stop([axis for axis in axes if speed[axis] >= 0.0])


class QuickStopIgnoredInMoves(Mutant):
    breaks = ("AxisDriver.quick_stop/starts", "ignored")
    found_by = "test_stopping.py::test_a_quick_stop_is_no_slower_than_a_stop"

    class Axes(SimAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            states = self._states
            super().quick_stop([a for a in axes if states.operation[a] != Operation.POSITION])


class StopIgnoredInJogs(Mutant):
    breaks = ("AxisDriver.stop/starts", "ignored")
    found_by = "test_ramps.py::test_a_velocity_command_has_the_ramps_of_its_profile"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            states = self._states
            super().stop([a for a in axes if states.operation[a] != Operation.VELOCITY])


class StopByRampOfTheMoveBefore(Mutant):
    breaks = ("AxisDriver.stop/ramp", "second call")
    found_by = "test_ramps.py::test_a_stop_has_the_ramp_of_the_move"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            before = self.__dict__.setdefault("ramps", {}).get(axis, 4.0)
            self.__dict__["ramps"][axis] = profile.deceleration
            super().move(axis, target, profile)
            self._motion._deceleration[axis] = before


class QuickStopThatCutsThePower(Mutant):
    breaks = ("AxisDriver.quick_stop/idle", "side effect")
    found_by = "test_stopping.py::test_a_stop_of_a_standing_axis_has_no_effect"

    class Axes(SimAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            with self._world.lock:
                self._world.advance()
                for axis in axes:
                    self._simulation.power.turn_off(axis)


class StopOfAFastAxisOnly(Mutant):
    breaks = ("AxisDriver.stop/starts", "small")
    found_by = "test_ramps.py::test_a_stop_ends_a_trajectory"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            speed = np.abs(self._simulation.servo.command_velocity)
            super().stop([axis for axis in axes if speed[axis] > 0.3])


class StopRebounds(Mutant):
    """5 mrad back, a tenth of a second after the stop."""

    breaks = ("AxisDriver.stop/rests", "side effect")
    found_by = "test_ramps.py::test_an_axis_that_is_stopped_neither_returns_nor_goes_on"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            super().stop(axes)
            for axis in axes:
                self._world.at(self._world.tick + 300, partial(self._rebound, axis))

        def _rebound(self, axis: int) -> None:
            if self._states.servo_on[axis] and self._motion.is_idle(axis):
                here = float(self._simulation.servo.command[axis])
                self._motion.move(axis, here - 0.005, Profile(0.1, 4.0, 4.0))


class StopsLate(Mutant):
    breaks = ("AxisDriver.stop/starts", "late")
    found_by = "test_stopping.py::test_a_stop_takes_the_time_and_distance_of_its_ramp"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            with self._world.lock:
                self._world.advance()
                for axis in axes:
                    self._world.at(self._world.tick + 120, partial(self._motion.stop, axis))


class EnablingStops(Mutant):
    """Servo-on of an axis that is on begins anew, and forgets the motion."""

    breaks = ("AxisDriver.servo/enabled", "side effect")
    found_by = "test_enable.py::test_enabling_an_axis_in_motion_changes_nothing"
    says = "targets"

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            if on and self._states.servo_on[axis]:
                self.stop([axis])
            super().servo(axis, on, timeout_s)


class QuickStopKeepsThePower(Mutant):
    """Servo-off has no effect in the state that a quick stop leads to."""

    breaks = ("AxisDriver.servo/disables", "ignored")
    found_by = "test_stopping.py::test_a_servo_goes_off_and_on_after_a_quick_stop"

    class Axes(SimAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            super().quick_stop(axes)
            self.__dict__.setdefault("stopped", set()).update(axes)

        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            if on or axis not in self.__dict__.get("stopped", set()):
                super().servo(axis, on, timeout_s)
