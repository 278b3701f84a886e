"""Mutants: faults of other sets, at the last axis or node only."""

from __future__ import annotations

from tests.features.conformance.runs.mutants import (
    axis_cells_mutants,
    blind_axes_mutants,
    feedback_mutants,
    following_commands_mutants,
    foreign_sets_later_mutants,
    late_effects_mutants,
    nodes_and_locks_mutants,
    scale_and_parameters_mutants,
    selective,
    stop_cells_mutants,
    stream_and_image_cells_mutants,
    while_it_happens_mutants,
)
from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import FloatArray
from robotd_sim import SimAxes


class LastOperationNeverStream(Mutant):
    breaks = ("AxisDriver.begin_stream/operation", "last axis")
    found_by = "test_streams.py::test_a_setpoint_is_reached_when_it_is_due"
    Axes = selective.last_axis(stream_and_image_cells_mutants.OperationNeverStream.Axes)


class LastVelocityStreamCoastsToRest(Mutant):
    breaks = ("AxisDriver.end_stream/velocity", "last axis")
    found_by = "test_velocity_commands.py::test_a_velocity_stream_that_ends_slows_to_rest"
    Axes = selective.last_axis(stream_and_image_cells_mutants.VelocityStreamCoastsToRest.Axes)


class LastCommandKeepsItsOldNumber(Mutant):
    breaks = ("AxisDriver.home/command", "last axis")
    found_by = "test_scale_and_home.py::test_the_command_is_zero_after_homing_too"
    Axes = selective.last_axis(scale_and_parameters_mutants.CommandKeepsItsOldNumber.Axes)


class LastHomingReturnsEarly(Mutant):
    breaks = ("AxisDriver.home/waits", "last axis")
    found_by = "test_scaling.py::test_homing_again_makes_the_new_position_zero"
    Axes = selective.last_axis(axis_cells_mutants.HomingReturnsEarly.Axes)


class LastJogChangesIgnored(Mutant):
    breaks = ("AxisDriver.jog/changes", "last axis")
    found_by = "test_velocity_commands.py::test_a_velocity_command_is_changed_without_a_jump"
    Axes = selective.last_axis(axis_cells_mutants.JogChangesIgnored.Axes)


class LastRampsOfTheFirstJog(Mutant):
    breaks = ("AxisDriver.jog/profile", "last axis")
    found_by = "test_small_and_large.py::test_each_velocity_command_has_its_own_ramps"
    Axes = selective.last_axis(axis_cells_mutants.RampsOfTheFirstJog.Axes)


class LastCreepsAtZero(Mutant):
    breaks = ("AxisDriver.jog/zero", "last axis")
    found_by = "test_velocity_commands.py::test_a_velocity_command_moves_its_axis_alone"
    Axes = selective.last_axis(axis_cells_mutants.CreepsAtZero.Axes)


class LastFartherTargetsIgnored(Mutant):
    breaks = ("AxisDriver.move/overrides", "last axis")
    found_by = "test_small_and_large.py::test_small_moves_add_up"
    Axes = selective.last_axis(blind_axes_mutants.FartherTargetsIgnored.Axes)


class LastLessBackwards(Mutant):
    breaks = ("AxisDriver.move/target", "last axis")
    found_by = "test_ramps.py::test_a_radian_is_a_radian_far_from_zero_and_beyond_a_turn"
    Axes = selective.last_axis(axis_cells_mutants.LessBackwards.Axes)


class LastMovesOfAStoppingAxisLost(Mutant):
    breaks = ("AxisDriver.move/while-stopping", "last axis")
    found_by = "test_overrides.py::test_a_move_during_a_stop_is_rejected_or_made"
    Axes = selective.last_axis(following_commands_mutants.MovesOfAStoppingAxisLost.Axes)


class LastQuickStopTakesEightMilliseconds(Mutant):
    breaks = ("AxisDriver.quick_stop/returns", "last axis")
    found_by = "test_ramps.py::test_a_stop_returns_at_once"
    Axes = selective.last_axis(stop_cells_mutants.QuickStopTakesEightMilliseconds.Axes)


class LastCommandedVelocityWithoutSign(Mutant):
    breaks = ("AxisDriver.read/commands", "last axis")
    found_by = "test_units.py::test_the_velocity_is_the_slope_of_the_position"
    Axes = selective.last_axis(blind_axes_mutants.CommandedVelocityWithoutSign.Axes)


class LastStopOfAJogShownAsAMove(Mutant):
    breaks = ("AxisDriver.read/mode", "last axis")
    found_by = "test_while_it_happens.py::test_what_is_stopped_is_not_shown_as_a_move"
    Axes = selective.last_axis(while_it_happens_mutants.StopOfAJogShownAsAMove.Axes)


class LastTorqueZero(Mutant):
    breaks = ("AxisDriver.read/nan", "last axis")
    found_by = "test_feedback.py::test_torque_pushes_the_way_the_axis_accelerates_or_is_not_known"
    Axes = selective.last_axis(feedback_mutants.TorqueZero.Axes)


class LastReasonStaysUntilAnAlarmIsCleared(Mutant):
    breaks = ("AxisDriver.read/reason", "last axis")
    found_by = "test_watchdog.py::test_the_reason_of_a_stop_ends_with_the_next_command"
    Axes = selective.last_axis(foreign_sets_later_mutants.ReasonStaysUntilAnAlarmIsCleared.Axes)


class LastServoReturnsAfterItsTime(Mutant):
    breaks = ("AxisDriver.servo/waits", "last axis")
    found_by = "test_enable.py::test_what_takes_too_long_is_a_time_out"
    Axes = selective.last_axis(foreign_sets_later_mutants.ServoReturnsAfterItsTime.Axes)


class LastGearRatioOfAnEnabledAxis(Mutant):
    breaks = ("AxisDriver.set_gear_ratio/servo-off", "last axis")
    found_by = "test_scaling.py::test_the_scale_of_an_enabled_axis_is_not_changed"
    Axes = selective.last_axis(axis_cells_mutants.GearRatioOfAnEnabledAxis.Axes)


class LastPolarityOfAnEnabledAxis(Mutant):
    breaks = ("AxisDriver.set_polarity/servo-off", "last axis")
    found_by = "test_scaling.py::test_the_scale_of_an_enabled_axis_is_not_changed"
    Axes = selective.last_axis(axis_cells_mutants.PolarityOfAnEnabledAxis.Axes)


class LastStopsOfJogsWait(Mutant):
    breaks = ("AxisDriver.stop/returns", "last axis")
    found_by = "test_ramps.py::test_a_stop_returns_at_once"
    Axes = selective.last_axis(foreign_sets_later_mutants.StopsOfJogsWait.Axes)


class LastMissingSubindexIsTheFirst(Mutant):
    breaks = ("FieldbusDriver.read_object/errors", "last axis")
    found_by = "test_bus_objects.py::test_a_missing_subindex_and_a_constant_are_errors_each_time"
    Fieldbus = selective.last_axis(nodes_and_locks_mutants.MissingSubindexIsTheFirst.Fieldbus)


class LastObjectsOfTheLastSecond(Mutant):
    breaks = ("FieldbusDriver.read_object/now", "last axis")
    found_by = (
        "test_bus_objects.py::test_a_position_object_follows_its_axis",
        "test_bus_objects.py::test_a_statusword_shows_whether_its_axis_is_on",
    )
    Fieldbus = selective.last_axis(nodes_and_locks_mutants.ObjectsOfTheLastSecond.Fieldbus)


class LastConstantsAreWrittenSilently(Mutant):
    breaks = ("FieldbusDriver.write_object/errors", "last axis")
    found_by = "test_bus_objects.py::test_a_missing_subindex_and_a_constant_are_errors_each_time"
    Fieldbus = selective.last_axis(nodes_and_locks_mutants.ConstantsAreWrittenSilently.Fieldbus)


class LastPolarityIsMeasuredLater(Mutant):
    breaks = ("AxisDriver.set_polarity/measured", "last axis")
    found_by = "test_scaling.py::test_polarity_is_set_and_not_toggled"
    Axes = selective.last_axis(late_effects_mutants.PolarityIsMeasuredLater.Axes)


class LastSetpointIsLate(Mutant):
    """By one setpoint."""

    breaks = ("AxisDriver.stream/setpoint", "last axis")
    found_by = "test_streams.py::test_a_setpoint_is_reached_when_it_is_due"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            before, late = vars(self).get("before", position), position.copy()
            vars(self)["before"] = position.copy()
            late[-1] = before[-1]
            super().stream(late, velocity, due_ns)
