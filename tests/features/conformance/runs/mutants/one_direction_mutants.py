"""Mutants: faults of motion and of scales in one direction only."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from tests.features.conformance.runs.mutants import (
    following_commands_mutants,
    ramps_mutants,
    selective,
    setpoints_mutants,
    stops_in_every_phase_mutants,
    stops_mutants,
    while_it_happens_mutants,
)
from tests.features.conformance.runs.mutants.plugin import Mutant, ReadAnew

from robotd.api import FloatArray, ProcessImage, Profile
from robotd_sim import SimAxes


class BackwardStopTooHard(Mutant):
    breaks = ("AxisDriver.stop/ramp", "one direction")
    found_by = "test_ramps.py::test_a_stop_has_the_ramp_of_the_move"
    Axes = selective.backwards(stops_mutants.StopTooHard.Axes)


class BackwardStopAndReturn(Mutant):
    breaks = ("AxisDriver.stop/rests", "one direction")
    found_by = "test_ramps.py::test_an_axis_that_is_stopped_neither_returns_nor_goes_on"
    Axes = selective.backwards(stops_mutants.StopAndReturn.Axes)


class BackwardStopsStreamsWithoutARamp(Mutant):
    breaks = ("AxisDriver.stop/stream", "one direction")
    found_by = "test_while_it_happens.py::test_a_stop_in_a_stream_has_a_ramp"
    Axes = selective.backwards(while_it_happens_mutants.StopsStreamsWithoutARamp.Axes)


class BackwardQuickStopDuringAStopIgnored(Mutant):
    breaks = ("AxisDriver.quick_stop/takes-over", "one direction")
    found_by = "test_command_sequences.py::test_a_quick_stop_of_a_gentle_move_is_quick"
    Axes = selective.backwards(stops_in_every_phase_mutants.QuickStopDuringAStopIgnored.Axes)


class BackwardMovesOfAStoppingAxisLost(Mutant):
    breaks = ("AxisDriver.move/while-stopping", "one direction")
    found_by = "test_overrides.py::test_a_move_during_a_stop_is_rejected_or_made"
    Axes = selective.backwards(following_commands_mutants.MovesOfAStoppingAxisLost.Axes)


class BackwardKeepsTheFirstTarget(Mutant):
    breaks = ("AxisDriver.move/overrides", "one direction")
    found_by = "test_profiles.py::test_a_new_target_is_taken_without_a_jump"
    Axes = selective.backwards(ramps_mutants.KeepsTheFirstTarget.Axes)


class StopsTheDirectionOfTheFirst(Mutant):
    """Of axes that move in both directions, those with the other sign go on."""

    breaks = ("AxisDriver.stop/all-axes", "one direction")
    found_by = "test_stops_of_some_axes.py::test_a_stop_reaches_each_named_axis_of_a_move"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            back = selective.move_backwards(self)
            super().stop([axis for axis in axes if (axis in back) == (axes[0] in back)])


class MovesFromRestGoForwards(Mutant):
    breaks = ("AxisDriver.move/starts", "one direction")
    found_by = "test_units.py::test_each_axis_moves_alone"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            if target >= self._simulation.servo.command[axis]:
                super().move(axis, target, profile)


class BackwardCommandShownAsZero(Mutant):
    breaks = ("AxisDriver.read/commands", "one direction")
    found_by = "test_units.py::test_the_velocity_is_the_slope_of_the_position"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.velocity_command[:] = np.maximum(image.velocity_command, 0.0)


class BackwardSetpointsAreLate(Mutant):
    """By one setpoint."""

    breaks = ("AxisDriver.stream/setpoint", "one direction")
    found_by = "test_streams.py::test_a_setpoint_is_reached_when_it_is_due"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            before = vars(self).get("before", position)
            vars(self)["before"] = position.copy()
            super().stream(np.where(position < before, before, position), velocity, due_ns)


class BackwardEndHoldsWhereItIs(Mutant):
    breaks = ("AxisDriver.end_stream/reached", "one direction")
    found_by = "test_setpoints.py::test_a_stream_ends_on_its_last_setpoint"
    Axes = selective.backwards(setpoints_mutants.EndHoldsWhereItIs.Axes)


class SpringsForwards(Mutant):
    """After a stream backwards an axis returns to where it began."""

    breaks = ("AxisDriver.end_stream/holds", "one direction")
    found_by = "test_trajectories.py::test_a_trajectory_arrives"

    class Axes(SimAxes):
        def begin_stream(self, axes: Sequence[int]) -> None:
            vars(self)["began"] = self._simulation.servo.command.copy()
            super().begin_stream(axes)

        def end_stream(self, axes: Sequence[int]) -> None:
            super().end_stream(axes)
            for axis in axes:
                began = float(vars(self)["began"][axis])
                if self._simulation.servo.command[axis] < began:
                    self.move(axis, began, Profile(0.5, 5.0, 5.0))


class PolarityIsNotTurnedBack(Mutant):
    breaks = ("AxisDriver.set_polarity/sets", "one direction")
    found_by = "test_scaling.py::test_polarity_is_set_and_not_toggled"

    class Axes(SimAxes):
        def set_polarity(self, axis: int, polarity: int) -> None:
            if polarity < 0:
                super().set_polarity(axis, polarity)


class PositivePositionsKeepTheirSign(Mutant):
    """In a turned axis."""

    breaks = ("AxisDriver.set_polarity/measured", "one direction")
    found_by = "test_scaling.py::test_polarity_is_set_and_not_toggled"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            turned = self._simulation.parameters["AxisPolarity"][: len(image.position)] < 0.0
            image.position[turned & (image.position < 0.0)] *= -1.0


class TurningBackResetsTheGear(Mutant):
    breaks = ("AxisDriver.set_polarity/ratio", "one direction")
    found_by = "test_scale_and_home.py::test_polarity_and_gear_ratio_leave_each_other_alone"
    says = "polarity 1 of axis"

    class Axes(SimAxes):
        def set_polarity(self, axis: int, polarity: int) -> None:
            turned = self._simulation.parameters["AxisPolarity"][axis] < 0.0
            super().set_polarity(axis, polarity)
            if turned and polarity > 0:
                self.set_gear_ratio(axis, 2.0**18, 2.0 * np.pi)


class LowerRatioTurnsTheAxisBack(Mutant):
    breaks = ("AxisDriver.set_gear_ratio/polarity", "one direction")
    found_by = "test_scale_and_home.py::test_polarity_and_gear_ratio_leave_each_other_alone"
    says = "gear ratio of axis"

    class Axes(SimAxes):
        def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
            before = abs(float(self._simulation.scaling.gain[axis]))
            super().set_gear_ratio(axis, numerator, denominator)
            if abs(float(self._simulation.scaling.gain[axis])) < before:
                self.set_polarity(axis, 1)


class RatioOfTurnedAxesIsKept(Mutant):
    """A gear ratio is in force in the positive direction of the encoder only."""

    breaks = ("AxisDriver.set_gear_ratio/counts", "one direction")
    found_by = "test_scale_and_home.py::test_polarity_and_gear_ratio_leave_each_other_alone"
    says = "gear ratio of axis"

    class Axes(SimAxes):
        def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
            if self._simulation.parameters["AxisPolarity"][axis] > 0.0:
                super().set_gear_ratio(axis, numerator, denominator)
