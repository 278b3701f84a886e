"""Mutants: Stops that depend on what runs, on the phase of it, or on the axes beside it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import Operation
from robotd_sim import SimAxes

BESIDE_IDLE = "test_stop_ramps.py::test_a_stop_of_moving_and_idle_axes_stops_all_that_move"
WITHOUT_POWER = "test_stop_ramps.py::test_a_stop_reaches_axes_beside_one_without_power"
KINDS = "test_stop_ramps.py::test_one_stop_ends_motions_of_every_kind"
SPEEDS_UP = "test_stop_ramps.py::test_an_axis_that_is_stopped_speeds_up_no_more"
MOVE_TURNS = "test_command_sequences.py::test_a_stop_of_a_move_that_turns_lets_it_not_turn"
JOG_PHASES = "test_command_sequences.py::test_a_stop_of_a_velocity_command_ends_it_in_every_phase"
GENTLE_MOVE = "test_command_sequences.py::test_a_quick_stop_of_a_gentle_move_is_quick"
GENTLE_JOG = "test_command_sequences.py::test_a_quick_stop_of_a_gentle_velocity_command_is_quick"


def speeds_up(axes: SimAxes, axis: int) -> bool:
    """The speed of the command of ``axis`` grows now."""
    with axes._world.lock:
        axes._world.advance()
        servo = axes._simulation.servo
        return float(servo.command_velocity[axis] * servo.command_acceleration[axis]) > 0.0


class StopLeavesTheNeighbourOfAnIdleAxis(Mutant):
    breaks = ("AxisDriver.stop/all-axes", "last axis")
    found_by = BESIDE_IDLE

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            idle = {a + 1 for a in axes if self._states.operation[a] == Operation.IDLE}
            super().stop([axis for axis in axes if axis not in idle])


class QuickStopOfAllWithAnIdleOneIgnored(Mutant):
    breaks = ("AxisDriver.quick_stop/starts", "ignored")
    found_by = BESIDE_IDLE

    class Axes(SimAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            if all(self._states.operation[axis] != Operation.IDLE for axis in axes):
                super().quick_stop(axes)


class StopEndsAtAnAxisWithoutPower(Mutant):
    breaks = ("AxisDriver.stop/all-axes", "wrong axis")
    found_by = WITHOUT_POWER

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            for axis in axes:
                if not self._states.servo_on[axis]:
                    return
                super().stop([axis])


class StopOfTheModeOfTheFirst(Mutant):
    breaks = ("AxisDriver.stop/all-axes", "last axis")
    found_by = KINDS

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            modes = self._states.mode
            super().stop([axis for axis in axes if modes[axis] == modes[axes[0]]])


class QuickStopLeavesStreamsBesideMoves(Mutant):
    breaks = ("AxisDriver.quick_stop/starts", "last axis")
    found_by = KINDS

    class Axes(SimAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            operations = self._states.operation
            moves = any(operations[axis] == Operation.POSITION for axis in axes)
            super().quick_stop([a for a in axes if not moves or operations[a] != Operation.STREAM])


class StopWaitsForTheSpeed(Mutant):
    """A stop while an axis speeds up begins when it has its speed."""

    breaks = ("AxisDriver.stop/starts", "late")
    found_by = (SPEEDS_UP, JOG_PHASES)

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            for axis in axes:
                if not speeds_up(self, axis):
                    super().stop([axis])
                    continue
                number, ticks = self._motion.plan(axis), round(0.1 / self._simulation.servo.tick_s)

                def later(axis: int = axis, number: int = number) -> None:
                    if self._motion.plan(axis) == number:
                        self._motion.stop(axis)

                self._world.at(self._world.tick + ticks, later)


class QuickStopIgnoredWhileItSpeedsUp(Mutant):
    breaks = ("AxisDriver.quick_stop/starts", "ignored")
    found_by = (SPEEDS_UP, JOG_PHASES)

    class Axes(SimAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            super().quick_stop([axis for axis in axes if not speeds_up(self, axis)])


class StopInATurnIgnored(Mutant):
    """While an axis slows down to turn, it is taken for one that stops."""

    breaks = ("AxisDriver.stop/starts", "ignored")
    found_by = (MOVE_TURNS, JOG_PHASES)

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            super().stop([axis for axis in axes if not self._slows_down(axis)])

        def _slows_down(self, axis: int) -> bool:
            servo = self._simulation.servo
            return float(servo.command_velocity[axis] * servo.command_acceleration[axis]) < 0.0


class QuickStopAtTheEndOfAMoveIgnored(Mutant):
    breaks = ("AxisDriver.quick_stop/starts", "ignored")
    found_by = GENTLE_MOVE

    class Axes(SimAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            servo, operations = self._simulation.servo, self._states.operation
            slowing = servo.command_velocity * servo.command_acceleration < 0.0
            ends = slowing & (np.array(operations[: len(slowing)]) == Operation.POSITION)
            super().quick_stop([axis for axis in axes if not ends[axis]])


class QuickStopDuringAStopIgnored(Mutant):
    breaks = ("AxisDriver.quick_stop/takes-over", "ignored")
    found_by = (GENTLE_MOVE, GENTLE_JOG)

    class Axes(SimAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            stopping = Operation.STOPPING
            super().quick_stop([a for a in axes if self._states.operation[a] != stopping])


class QuickStopDuringAStopLeavesTheLast(Mutant):
    breaks = ("AxisDriver.quick_stop/takes-over", "last axis")
    found_by = GENTLE_MOVE

    class Axes(SimAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            if self._states.operation[axes[-1]] == Operation.STOPPING:
                axes = axes[:-1]
            super().quick_stop(axes)


class QuickStopOfAJogIsItsStop(Mutant):
    breaks = ("AxisDriver.quick_stop/starts", "wrong value")
    found_by = GENTLE_JOG

    class Axes(SimAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            jogs = [a for a in axes if self._states.operation[a] == Operation.VELOCITY]
            self.stop(jogs)
            super().quick_stop([axis for axis in axes if axis not in jogs])


class QuickStopSofterThanAHardStop(Mutant):
    breaks = ("AxisDriver.quick_stop/starts", "wrong value")
    found_by = "test_stop_ramps.py::test_a_quick_stop_is_no_gentler_than_the_hardest_stop"

    class Axes(SimAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            moving = [a for a in axes if self._states.operation[a] != Operation.IDLE]
            super().quick_stop(axes)
            with self._world.lock:
                for axis in moving:
                    self._motion.brake(axis, 7.0)


class StopProlongsAQuickStop(Mutant):
    breaks = ("AxisDriver.stop/again", "side effect")
    found_by = "test_command_sequences.py::test_a_stop_does_not_prolong_a_quick_stop"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            quick = [a for a in axes if self._states.operation[a] == Operation.STOPPING]
            super().stop(axes)
            with self._world.lock:
                for axis in quick:
                    self._motion.brake(axis, self._motion._deceleration[axis])


class CommandJumpsBackAtAStop(Mutant):
    """By the following error: the stop begins at the measured position."""

    breaks = ("AxisDriver.stop/rests", "side effect")
    found_by = "test_stop_ramps.py::test_a_stop_has_the_ramp_of_the_last_move"
    says = "jumps"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            servo = self._simulation.servo
            with self._world.lock:
                self._world.advance()
                for axis in axes:
                    if self._states.operation[axis] == Operation.POSITION:
                        speed = float(servo.command_velocity[axis])
                        behind = float(servo.command[axis]) - 0.005 * np.sign(speed)
                        servo.place(axis, float(servo.position[axis]), behind, speed)
            super().stop(axes)
