"""Mutants: motion that is wrong from the second connection on."""

from __future__ import annotations

from tests.features.conformance.runs.mutants import (
    axis_cells_mutants,
    blind_axes_mutants,
    following_commands_mutants,
    foreign_sets_later_mutants,
    later,
    resumption_mutants,
    setpoints_mutants,
    stop_cells_mutants,
    stops_in_every_phase_mutants,
    stops_mutants,
    stream_and_image_cells_mutants,
    units_mutants,
    while_it_happens_mutants,
)

MOVES_AGAIN = "test_again.py::test_moves_again"
SERVOS_AND_ALARMS_AGAIN = "test_again.py::test_servos_and_alarms_again"
STOPS_AGAIN = "test_again.py::test_stops_again"
STREAMS_AGAIN = "test_again.py::test_streams_again"
VALUES_AGAIN = "test_again.py::test_values_again"
VELOCITY_COMMANDS_AGAIN = "test_again.py::test_velocity_commands_again"
VELOCITY_STREAMS_AGAIN = "test_again.py::test_velocity_streams_again"


class LaterRejectedBeginsEndStreams(later.LaterMutant):
    breaks = ("AxisDriver.begin_stream/again", "after re-open")
    found_by = STREAMS_AGAIN
    only = "a_stream_of_an_axis_that_is_off_begins_for_none"
    Axes = later.later(foreign_sets_later_mutants.RejectedBeginsEndStreams.Axes)


class LaterStreamsThoseThatCan(later.LaterMutant):
    breaks = ("AxisDriver.begin_stream/all", "after re-open")
    found_by = STREAMS_AGAIN
    only = "a_stream_of_an_axis_that_is_off_begins_for_none"
    Axes = later.later(resumption_mutants.StreamsThoseThatCan.Axes)


class LaterPositionsComeFirst(later.LaterMutant):
    breaks = ("AxisDriver.begin_stream/modes", "after re-open")
    found_by = STREAMS_AGAIN
    only = "enabling_changes_no_kind_of_motion"
    Axes = later.later(setpoints_mutants.PositionsComeFirst.Axes)


class LaterClearingStopsAMove(later.LaterMutant):
    breaks = ("AxisDriver.clear_alarm/idle", "after re-open")
    found_by = SERVOS_AND_ALARMS_AGAIN
    only = "clearing_without_an_alarm_disturbs_no_motion"
    Axes = later.later(stop_cells_mutants.ClearingStopsAMove.Axes)


class LaterClearsLater(later.LaterMutant):
    breaks = ("AxisDriver.clear_alarm/waits", "after re-open")
    found_by = SERVOS_AND_ALARMS_AGAIN
    only = "what_takes_too_long_is_a_time_out"
    Axes = later.later(stop_cells_mutants.ClearsLater.Axes)


class LaterLastDriveIsNeverConfirmed(later.LaterMutant):
    breaks = ("AxisDriver.confirmed_off/confirmed", "after re-open")
    found_by = VALUES_AGAIN
    only = "a_drive_is_confirmed_to_be_off_where_it_answers"
    Axes = later.later(while_it_happens_mutants.LastDriveIsNeverConfirmed.Axes)


class LaterEndsEveryStream(later.LaterMutant):
    breaks = ("AxisDriver.end_stream/holds", "after re-open")
    found_by = STREAMS_AGAIN
    only = "enabling_changes_no_kind_of_motion"
    Axes = later.later(stream_and_image_cells_mutants.EndsEveryStream.Axes)


class LaterTheEndOfNoStreamStopsAMove(later.LaterMutant):
    breaks = ("AxisDriver.end_stream/idle", "after re-open")
    found_by = STREAMS_AGAIN
    only = "enabling_changes_no_kind_of_motion"
    Axes = later.later(resumption_mutants.TheEndOfNoStreamStopsAMove.Axes)


class LaterEndHoldsWhereItIs(later.LaterMutant):
    breaks = ("AxisDriver.end_stream/reached", "after re-open")
    found_by = STREAMS_AGAIN
    only = "a_stream_ends_on_its_last_setpoint"
    Axes = later.later(setpoints_mutants.EndHoldsWhereItIs.Axes)


class LaterVelocityStreamCoastsToRest(later.LaterMutant):
    breaks = ("AxisDriver.end_stream/velocity", "after re-open")
    found_by = VELOCITY_STREAMS_AGAIN
    only = "a_velocity_stream_that_ends_slows_to_rest"
    Axes = later.later(stream_and_image_cells_mutants.VelocityStreamCoastsToRest.Axes)


class LaterJogChangesIgnored(later.LaterMutant):
    breaks = ("AxisDriver.jog/changes", "after re-open")
    found_by = VELOCITY_COMMANDS_AGAIN
    only = "each_change_of_a_velocity_command_has_its_own_ramps"
    Axes = later.later(axis_cells_mutants.JogChangesIgnored.Axes)


class LaterJogSlowsDownAsBefore(later.LaterMutant):
    breaks = ("AxisDriver.jog/new-profile", "after re-open")
    found_by = VELOCITY_COMMANDS_AGAIN
    only = "each_change_of_a_velocity_command_has_its_own_ramps"
    Axes = later.later(following_commands_mutants.JogSlowsDownAsBefore.Axes)


class LaterRampsOfTheFirstJog(later.LaterMutant):
    breaks = ("AxisDriver.jog/profile", "after re-open")
    found_by = VELOCITY_COMMANDS_AGAIN
    only = "each_change_of_a_velocity_command_has_its_own_ramps"
    Axes = later.later(axis_cells_mutants.RampsOfTheFirstJog.Axes)


class LaterCreepsAtZero(later.LaterMutant):
    breaks = ("AxisDriver.jog/zero", "after re-open")
    found_by = VELOCITY_COMMANDS_AGAIN
    only = "each_change_of_a_velocity_command_has_its_own_ramps"
    Axes = later.later(axis_cells_mutants.CreepsAtZero.Axes)


class LaterOverrideSpeedsUpAsBefore(later.LaterMutant):
    breaks = ("AxisDriver.move/new-profile", "after re-open")
    found_by = MOVES_AGAIN
    only = "a_move_that_overrides_another_has_its_own_ramps"
    Axes = later.later(following_commands_mutants.OverrideSpeedsUpAsBefore.Axes)


class LaterFartherTargetsIgnored(later.LaterMutant):
    breaks = ("AxisDriver.move/overrides", "after re-open")
    found_by = MOVES_AGAIN
    only = "small_moves_add_up"
    Axes = later.later(blind_axes_mutants.FartherTargetsIgnored.Axes)


class LaterAccelerationThreeQuarters(later.LaterMutant):
    breaks = ("AxisDriver.move/profile", "after re-open")
    found_by = MOVES_AGAIN
    only = "a_move_that_overrides_another_has_its_own_ramps"
    Axes = later.later(axis_cells_mutants.AccelerationThreeQuarters.Axes)


class LaterLessBackwards(later.LaterMutant):
    breaks = ("AxisDriver.move/target", "after re-open")
    found_by = MOVES_AGAIN
    only = "a_commanded_radian_is_a_measured_radian"
    Axes = later.later(axis_cells_mutants.LessBackwards.Axes)


class LaterMovesOfAStoppingAxisLost(later.LaterMutant):
    breaks = ("AxisDriver.move/while-stopping", "after re-open")
    found_by = MOVES_AGAIN
    only = "a_move_during_a_stop_is_rejected_or_made"
    Axes = later.later(following_commands_mutants.MovesOfAStoppingAxisLost.Axes)


class LaterQuickStopThatCutsThePower(later.LaterMutant):
    breaks = ("AxisDriver.quick_stop/idle", "after re-open")
    found_by = STOPS_AGAIN
    only = "a_stop_of_a_standing_axis_has_no_effect"
    Axes = later.later(stops_mutants.QuickStopThatCutsThePower.Axes)


class LaterStopProlongsAQuickStop(later.LaterMutant):
    breaks = ("AxisDriver.stop/again", "after re-open")
    found_by = STOPS_AGAIN
    only = "a_stop_does_not_prolong_a_quick_stop"
    Axes = later.later(stops_in_every_phase_mutants.StopProlongsAQuickStop.Axes)


class LaterStopLeavesTheNeighbourOfAnIdleAxis(later.LaterMutant):
    breaks = ("AxisDriver.stop/all-axes", "after re-open")
    found_by = STOPS_AGAIN
    only = "a_stop_of_moving_and_idle_axes_stops_all_that_move"
    Axes = later.later(stops_in_every_phase_mutants.StopLeavesTheNeighbourOfAnIdleAxis.Axes)


class LaterStopOfAnIdleAxisIsNotComplete(later.LaterMutant):
    breaks = ("AxisDriver.stop/idle", "after re-open")
    found_by = STOPS_AGAIN
    only = "a_stop_of_a_standing_axis_has_no_effect"
    Axes = later.later(foreign_sets_later_mutants.StopOfAnIdleAxisIsNotComplete.Axes)


class LaterStopTakesEightMilliseconds(later.LaterMutant):
    breaks = ("AxisDriver.stop/returns", "after re-open")
    found_by = STOPS_AGAIN
    only = "a_stop_returns_at_once"
    Axes = later.later(stop_cells_mutants.StopTakesEightMilliseconds.Axes)


class LaterLateSetpointsAreDropped(later.LaterMutant):
    breaks = ("AxisDriver.stream/late", "after re-open")
    found_by = STREAMS_AGAIN
    only = "a_setpoint_that_was_too_late_has_no_effect"
    Axes = later.later(foreign_sets_later_mutants.LateSetpointsAreDropped.Axes)


class LaterVelocityChangesAtOnce(later.LaterMutant):
    breaks = ("AxisDriver.stream/velocity", "after re-open")
    found_by = VELOCITY_STREAMS_AGAIN
    only = "a_streamed_velocity_changes_evenly"
    Axes = later.later(setpoints_mutants.VelocityChangesAtOnce.Axes)


class LaterClosedSwitchesSwallowCommands(later.LaterMutant):
    breaks = ("AxisDriver/as-commanded", "after re-open")
    found_by = MOVES_AGAIN
    only = "a_move_during_a_stop_is_rejected_or_made"
    Axes = later.later(foreign_sets_later_mutants.ClosedSwitchesSwallowCommands.Axes)


class LaterSignFlipped(later.LaterMutant):
    breaks = ("drivers/units", "after re-open")
    found_by = MOVES_AGAIN
    only = "a_commanded_radian_is_a_measured_radian"
    Axes = later.later(units_mutants.SignFlipped.Axes)
