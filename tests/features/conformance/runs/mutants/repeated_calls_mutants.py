"""Mutants: faults of other sets, from the second equal call on."""

from __future__ import annotations

from tests.features.conformance.runs.mutants import (
    alarms_mutants,
    axis_cells_mutants,
    blind_axes_mutants,
    blind_device_mutants,
    blind_further_mutants,
    bus_cells_mutants,
    cost_mutants,
    device_cells_mutants,
    foreign_sets_later_mutants,
    foreign_sets_mutants,
    nodes_and_locks_mutants,
    open_again_mutants,
    resumption_mutants,
    scale_and_parameters_mutants,
    selective,
    setpoints_mutants,
    stop_cells_mutants,
    stream_and_image_cells_mutants,
    while_it_happens_mutants,
)
from tests.features.conformance.runs.mutants.plugin import Mutant


class RepeatedRejectedBeginsEndStreams(Mutant):
    breaks = ("AxisDriver.begin_stream/again", "second call")
    found_by = "test_axes_apart.py::test_a_stream_of_an_axis_that_is_off_begins_for_none"
    Axes = selective.repeated(foreign_sets_later_mutants.RejectedBeginsEndStreams.Axes)


class RepeatedStreamsThoseThatCan(Mutant):
    breaks = ("AxisDriver.begin_stream/all", "second call")
    found_by = "test_axes_apart.py::test_a_stream_of_an_axis_that_is_off_begins_for_none"
    Axes = selective.repeated(resumption_mutants.StreamsThoseThatCan.Axes)


class RepeatedClearingRaisesWithoutAlarm(Mutant):
    breaks = ("AxisDriver.clear_alarm/idle", "second call")
    found_by = "test_faults.py::test_clearing_without_an_alarm_has_no_effect"
    Axes = selective.repeated(blind_further_mutants.ClearingRaisesWithoutAlarm.Axes)


class RepeatedClearsLater(Mutant):
    breaks = ("AxisDriver.clear_alarm/waits", "second call")
    found_by = "test_last_axis.py::test_an_alarm_of_the_last_axis"
    Axes = selective.repeated(stop_cells_mutants.ClearsLater.Axes)


class RepeatedTheEndOfNoStreamStopsAMove(Mutant):
    breaks = ("AxisDriver.end_stream/idle", "second call")
    found_by = "test_axes_apart.py::test_enabling_changes_no_kind_of_motion"
    Axes = selective.repeated(resumption_mutants.TheEndOfNoStreamStopsAMove.Axes)


class RepeatedEndHoldsWhereItIs(Mutant):
    breaks = ("AxisDriver.end_stream/reached", "second call")
    found_by = "test_setpoints.py::test_a_stream_ends_on_its_last_setpoint"
    Axes = selective.repeated(setpoints_mutants.EndHoldsWhereItIs.Axes)


class RepeatedVelocityStreamCoastsToRest(Mutant):
    breaks = ("AxisDriver.end_stream/velocity", "second call")
    found_by = "test_velocity_commands.py::test_a_velocity_stream_that_ends_slows_to_rest"
    Axes = selective.repeated(stream_and_image_cells_mutants.VelocityStreamCoastsToRest.Axes)


class RepeatedHomingReturnsEarly(Mutant):
    breaks = ("AxisDriver.home/waits", "second call")
    found_by = "test_scaling.py::test_homing_again_makes_the_new_position_zero"
    Axes = selective.repeated(axis_cells_mutants.HomingReturnsEarly.Axes)


class RepeatedQuickStopTakesEightMilliseconds(Mutant):
    breaks = ("AxisDriver.quick_stop/returns", "second call")
    found_by = "test_ramps.py::test_a_stop_returns_at_once"
    Axes = selective.repeated(stop_cells_mutants.QuickStopTakesEightMilliseconds.Axes)


class RepeatedNewArrays(Mutant):
    breaks = ("AxisDriver.read/in-place", "second call")
    found_by = "test_cost.py::test_read_fills_the_arrays_that_it_is_given"
    Axes = selective.repeated(cost_mutants.NewArrays.Axes)


class RepeatedServoStaysOnWhileItStops(Mutant):
    breaks = ("AxisDriver.servo/disables", "second call")
    found_by = "test_last_axis.py::test_a_servo_goes_off_in_every_state"
    Axes = selective.repeated(stop_cells_mutants.ServoStaysOnWhileItStops.Axes)


class RepeatedEnablingStopsAVelocityCommand(Mutant):
    breaks = ("AxisDriver.servo/enabled", "second call")
    found_by = "test_axes_apart.py::test_enabling_changes_no_kind_of_motion"
    Axes = selective.repeated(resumption_mutants.EnablingStopsAVelocityCommand.Axes)


class RepeatedServoOnClearsAlarms(Mutant):
    breaks = ("AxisDriver.servo/switches", "second call")
    found_by = "test_feedback.py::test_switching_on_clears_no_alarm"
    Axes = selective.repeated(alarms_mutants.ServoOnClearsAlarms.Axes)


class RepeatedServoReturnsAfterItsTime(Mutant):
    breaks = ("AxisDriver.servo/waits", "second call")
    found_by = "test_enable.py::test_what_takes_too_long_is_a_time_out"
    Axes = selective.repeated(foreign_sets_later_mutants.ServoReturnsAfterItsTime.Axes)


class RepeatedStopsFromTheFirstToTheLast(Mutant):
    breaks = ("AxisDriver.stop/all-axes", "second call")
    found_by = "test_stops_of_some_axes.py::test_a_stop_reaches_each_named_axis_of_a_move"
    Axes = selective.repeated(foreign_sets_mutants.StopsFromTheFirstToTheLast.Axes)


class RepeatedSecondStopBeginsAnew(Mutant):
    breaks = ("AxisDriver.stop/idle", "second call")
    found_by = "test_stops_of_some_axes.py::test_a_repeated_stop_changes_nothing"
    Axes = selective.repeated(stop_cells_mutants.SecondStopBeginsAnew.Axes)


class RepeatedEachStopLeavesAThread(Mutant):
    breaks = ("AxisDriver.stop/rests", "second call")
    found_by = "test_leaks.py::test_nothing_grows_with_each_command"
    Axes = selective.repeated(blind_further_mutants.EachStopLeavesAThread.Axes)


class RepeatedStopsOfJogsWait(Mutant):
    breaks = ("AxisDriver.stop/returns", "second call")
    found_by = "test_ramps.py::test_a_stop_returns_at_once"
    Axes = selective.repeated(foreign_sets_later_mutants.StopsOfJogsWait.Axes)


class RepeatedStopsStreamsWithoutARamp(Mutant):
    breaks = ("AxisDriver.stop/stream", "second call")
    found_by = "test_while_it_happens.py::test_a_stop_in_a_stream_has_a_ramp"
    Axes = selective.repeated(while_it_happens_mutants.StopsStreamsWithoutARamp.Axes)


class RepeatedFaultThatBlocks(Mutant):
    breaks = ("DeviceDriver.fault/blocks", "second call")
    found_by = "test_ageing.py::test_the_device_says_at_once_why_it_is_silent"
    Device = selective.repeated(alarms_mutants.FaultThatBlocks.Device)


class RepeatedParametersSurvive(Mutant):
    breaks = ("DeviceDriver.load_parameters/kept", "second call")
    found_by = "test_parameters.py::test_a_file_is_in_force_until_the_device_is_closed"
    Device = selective.repeated(foreign_sets_later_mutants.ParametersSurvive.Device)


class RepeatedRejectionNamesNoAxis(Mutant):
    breaks = ("DeviceDriver.load_parameters/named", "second call")
    found_by = "test_parameters.py::test_a_load_that_one_axis_forbids_changes_no_other"
    Device = selective.repeated(scale_and_parameters_mutants.RejectionNamesNoAxis.Device)


class RepeatedNotesSayNothing(Mutant):
    breaks = ("DeviceDriver.load_parameters/note", "second call")
    found_by = "test_parameters.py::test_a_note_says_what_a_file_leaves_out"
    Device = selective.repeated(scale_and_parameters_mutants.NotesSayNothing.Device)


class RepeatedStartAgainSwitchesOutputsOff(Mutant):
    breaks = ("DeviceDriver.start_communication/again", "second call")
    found_by = "test_open_again.py::test_a_device_that_is_open_keeps_its_outputs"
    Device = selective.repeated(open_again_mutants.StartAgainSwitchesOutputsOff.Device)


class RepeatedCannotResume(Mutant):
    breaks = ("DeviceDriver.start_communication/resumes", "second call")
    found_by = "test_reopening.py::test_a_lost_link_is_shown_and_resumed"
    Device = selective.repeated(device_cells_mutants.CannotResume.Device)


class RepeatedMemoryWithEachAnswer(Mutant):
    breaks = ("DeviceDriver.state/now", "second call")
    found_by = "test_process.py::test_reading_needs_no_memory"
    Device = selective.repeated(blind_device_mutants.MemoryWithEachAnswer.Device)


class RepeatedStatusOfAClosedDeviceRaises(Mutant):
    breaks = ("FieldbusDriver.status/states", "second call")
    found_by = "test_fieldbus.py::test_it_answers_in_every_state"
    Fieldbus = selective.repeated(bus_cells_mutants.StatusOfAClosedDeviceRaises.Fieldbus)


class RepeatedConstantsAreWrittenSilently(Mutant):
    breaks = ("FieldbusDriver.write_object/errors", "second call")
    found_by = "test_bus_objects.py::test_a_missing_subindex_and_a_constant_are_errors_each_time"
    Fieldbus = selective.repeated(nodes_and_locks_mutants.ConstantsAreWrittenSilently.Fieldbus)


class RepeatedTimeOutsOfTheLibrary(Mutant):
    breaks = ("drivers/errors", "second call")
    found_by = "test_enable.py::test_what_takes_too_long_is_a_time_out"
    Axes = selective.repeated(foreign_sets_mutants.TimeOutsOfTheLibrary.Axes)


class RepeatedOneCallerAtATime(Mutant):
    breaks = ("drivers/threads", "second call")
    found_by = "test_threads.py::test_switching_servos_does_not_disturb_the_cycle"
    Axes = selective.repeated(cost_mutants.OneCallerAtATime.Axes)


class RepeatedMovesBlockTheLoop(Mutant):
    breaks = ("drivers/timeouts", "second call")
    found_by = "test_threads.py::test_commands_to_all_axes_at_once"
    Axes = selective.repeated(blind_axes_mutants.MovesBlockTheLoop.Axes)
