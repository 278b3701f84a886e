"""Mutants: values, scales, I/O and objects that are wrong from the second connection on."""

from __future__ import annotations

from tests.features.conformance.runs.mutants import (
    axis_cells_mutants,
    blind_axes_mutants,
    blind_device_mutants,
    blind_further_mutants,
    bus_cells_mutants,
    connection_mutants,
    device_cells_mutants,
    feedback_mutants,
    foreign_sets_later_mutants,
    foreign_sets_mutants,
    later,
    nodes_and_locks_mutants,
    scale_and_parameters_mutants,
    stops_mutants,
)

HOMING_AGAIN = "test_again.py::test_homing_again"
IO_AGAIN = "test_again.py::test_io_again"
PARAMETERS_AGAIN = "test_again.py::test_parameters_again"
SCALES_AGAIN = "test_again.py::test_scales_again"
SERVOS_AND_ALARMS_AGAIN = "test_again.py::test_servos_and_alarms_again"
THE_FIELDBUS_AGAIN = "test_again.py::test_the_fieldbus_again"
VALUES_AGAIN = "test_again.py::test_values_again"


class LaterCommandKeepsItsOldNumber(later.LaterMutant):
    breaks = ("AxisDriver.home/command", "after re-open")
    found_by = HOMING_AGAIN
    only = "the_command_is_zero_after_homing_too"
    Axes = later.later(scale_and_parameters_mutants.CommandKeepsItsOldNumber.Axes)


class LaterHomingTurnsTheAxisBack(later.LaterMutant):
    breaks = ("AxisDriver.home/scale", "after re-open")
    found_by = PARAMETERS_AGAIN
    only = "homing_leaves_the_scale_alone"
    Axes = later.later(scale_and_parameters_mutants.HomingTurnsTheAxisBack.Axes)


class LaterHomingTakesTheServoOn(later.LaterMutant):
    breaks = ("AxisDriver.home/servo-off", "after re-open")
    found_by = HOMING_AGAIN
    only = "homing_with_the_servo_off_is_done_or_rejected"
    Axes = later.later(scale_and_parameters_mutants.HomingTakesTheServoOn.Axes)


class LaterHomingReturnsEarly(later.LaterMutant):
    breaks = ("AxisDriver.home/waits", "after re-open")
    found_by = HOMING_AGAIN
    only = "homing_again_makes_the_new_position_zero"
    Axes = later.later(axis_cells_mutants.HomingReturnsEarly.Axes)


class LaterSecondHomingIgnored(later.LaterMutant):
    breaks = ("AxisDriver.home/zero", "after re-open")
    found_by = HOMING_AGAIN
    only = "homing_again_makes_the_new_position_zero"
    Axes = later.later(axis_cells_mutants.SecondHomingIgnored.Axes)


class LaterCompleteTooEarly(later.LaterMutant):
    breaks = ("AxisDriver.read/complete", "after re-open")
    found_by = VALUES_AGAIN
    only = "a_move_shows_what_it_does"
    Axes = later.later(blind_axes_mutants.CompleteTooEarly.Axes)


class LaterTorqueZero(later.LaterMutant):
    breaks = ("AxisDriver.read/nan", "after re-open")
    found_by = VALUES_AGAIN
    only = "torque_pushes_the_way_the_axis_accelerates_or_is_not_known"
    Axes = later.later(feedback_mutants.TorqueZero.Axes)


class LaterReasonStaysUntilAnAlarmIsCleared(later.LaterMutant):
    breaks = ("AxisDriver.read/reason", "after re-open")
    found_by = VALUES_AGAIN
    only = "the_reason_of_an_alarm_comes_and_goes_with_it"
    Axes = later.later(foreign_sets_later_mutants.ReasonStaysUntilAnAlarmIsCleared.Axes)


class LaterLimitsSwapped(later.LaterMutant):
    breaks = ("AxisDriver.read/switches", "after re-open")
    found_by = VALUES_AGAIN
    only = "a_closed_switch_is_shown_alone_until_it_is_released"
    Axes = later.later(feedback_mutants.LimitsSwapped.Axes)


class LaterTorquesRotated(later.LaterMutant):
    breaks = ("AxisDriver.read/torque", "after re-open")
    found_by = VALUES_AGAIN
    only = "torque_pushes_the_way_the_axis_accelerates_or_is_not_known"
    Axes = later.later(blind_axes_mutants.TorquesRotated.Axes)


class LaterEnablingStops(later.LaterMutant):
    breaks = ("AxisDriver.servo/enabled", "after re-open")
    found_by = SERVOS_AND_ALARMS_AGAIN
    only = "enabling_an_axis_in_motion_changes_nothing"
    Axes = later.later(stops_mutants.EnablingStops.Axes)


class LaterServoReturnsAfterItsTime(later.LaterMutant):
    breaks = ("AxisDriver.servo/waits", "after re-open")
    found_by = SERVOS_AND_ALARMS_AGAIN
    only = "what_takes_too_long_is_a_time_out"
    Axes = later.later(foreign_sets_later_mutants.ServoReturnsAfterItsTime.Axes)


class LaterDenominatorIgnored(later.LaterMutant):
    breaks = ("AxisDriver.set_gear_ratio/counts", "after re-open")
    found_by = SCALES_AGAIN
    only = "a_gear_ratio_is_a_fraction"
    Axes = later.later(axis_cells_mutants.DenominatorIgnored.Axes)


class LaterSameGearTurnsTheAxis(later.LaterMutant):
    breaks = ("AxisDriver.set_gear_ratio/polarity", "after re-open")
    found_by = SCALES_AGAIN
    only = "polarity_and_gear_ratio_leave_each_other_alone"
    Axes = later.later(scale_and_parameters_mutants.SameGearTurnsTheAxis.Axes)


class LaterPolarityResetsTheGear(later.LaterMutant):
    breaks = ("AxisDriver.set_polarity/ratio", "after re-open")
    found_by = SCALES_AGAIN
    only = "polarity_and_gear_ratio_leave_each_other_alone"
    Axes = later.later(scale_and_parameters_mutants.PolarityResetsTheGear.Axes)


class LaterPolarityToggles(later.LaterMutant):
    breaks = ("AxisDriver.set_polarity/sets", "after re-open")
    found_by = SCALES_AGAIN
    only = "polarity_and_gear_ratio_leave_each_other_alone"
    Axes = later.later(axis_cells_mutants.PolarityToggles.Axes)


class LaterDumpWithTheGearOfTheFile(later.LaterMutant):
    breaks = ("DeviceDriver.dump_parameters/scale", "after re-open")
    found_by = PARAMETERS_AGAIN
    only = "a_dump_shows_what_is_changed_at_run_time"
    Device = later.later(scale_and_parameters_mutants.DumpWithTheGearOfTheFile.Device)


class LaterDumpOfTheLastIsTheFirst(later.LaterMutant):
    breaks = ("DeviceDriver.dump_parameters/text", "after re-open")
    found_by = PARAMETERS_AGAIN
    only = "a_dump_shows_what_is_changed_at_run_time"
    Device = later.later(blind_device_mutants.DumpOfTheLastIsTheFirst.Device)


class LaterStartAppliesTheDefaults(later.LaterMutant):
    breaks = ("DeviceDriver.load_parameters/kept", "after re-open")
    found_by = PARAMETERS_AGAIN
    only = "each_load_is_in_force_also_after_communication_stopped"
    Device = later.later(scale_and_parameters_mutants.StartAppliesTheDefaults.Device)


class LaterRescalesLiveAxes(later.LaterMutant):
    breaks = ("DeviceDriver.load_parameters/live", "after re-open")
    found_by = PARAMETERS_AGAIN
    only = "a_note_says_what_a_file_leaves_out"
    Device = later.later(connection_mutants.RescalesLiveAxes.Device)


class LaterRejectionNamesNoAxis(later.LaterMutant):
    breaks = ("DeviceDriver.load_parameters/named", "after re-open")
    found_by = PARAMETERS_AGAIN
    only = "a_load_that_one_axis_forbids_changes_no_other"
    Device = later.later(scale_and_parameters_mutants.RejectionNamesNoAxis.Device)


class LaterNotesSayNothing(later.LaterMutant):
    breaks = ("DeviceDriver.load_parameters/note", "after re-open")
    found_by = PARAMETERS_AGAIN
    only = "a_note_says_what_a_file_leaves_out"
    Device = later.later(scale_and_parameters_mutants.NotesSayNothing.Device)


class LaterDefaultsForAbsentAxes(later.LaterMutant):
    breaks = ("DeviceDriver.load_parameters/wrong-file", "after re-open")
    found_by = PARAMETERS_AGAIN
    only = "a_note_says_what_a_file_leaves_out"
    Device = later.later(connection_mutants.DefaultsForAbsentAxes.Device)


class LaterScanOfTheStart(later.LaterMutant):
    breaks = ("DeviceDriver.scan_network/summary", "after re-open")
    found_by = THE_FIELDBUS_AGAIN
    only = "a_lost_drive_is_missing_in_a_scan"
    Device = later.later(device_cells_mutants.ScanOfTheStart.Device)


class LaterAbortsWithoutTheirCode(later.LaterMutant):
    breaks = ("FieldbusDriver.read_object/errors", "after re-open")
    found_by = THE_FIELDBUS_AGAIN
    only = "an_object_that_the_node_does_not_have_is_an_error_without_effect"
    Fieldbus = later.later(foreign_sets_mutants.AbortsWithoutTheirCode.Fieldbus)


class LaterObjectsOfTheLastSecond(later.LaterMutant):
    breaks = ("FieldbusDriver.read_object/now", "after re-open")
    found_by = THE_FIELDBUS_AGAIN
    only = "a_written_object_is_in_its_node"
    Fieldbus = later.later(nodes_and_locks_mutants.ObjectsOfTheLastSecond.Fieldbus)


class LaterObjectsBigEndian(later.LaterMutant):
    breaks = ("FieldbusDriver.read_object/value", "after re-open")
    found_by = THE_FIELDBUS_AGAIN
    only = "a_written_object_is_in_its_node"
    Fieldbus = later.later(blind_device_mutants.ObjectsBigEndian.Fieldbus)


class LaterRegistersOfTheLastNodeWrong(later.LaterMutant):
    breaks = ("FieldbusDriver.read_register/memory", "after re-open")
    found_by = THE_FIELDBUS_AGAIN
    only = "registers_differ_from_each_other_and_between_nodes"
    Fieldbus = later.later(bus_cells_mutants.RegistersOfTheLastNodeWrong.Fieldbus)


class LaterCountsNoMoreAfterAReset(later.LaterMutant):
    breaks = ("FieldbusDriver.reset_statistics/zero", "after re-open")
    found_by = THE_FIELDBUS_AGAIN
    only = "lost_frames_are_counted_until_a_reset"
    Fieldbus = later.later(blind_further_mutants.CountsNoMoreAfterAReset.Fieldbus)


class LaterLostNodeWithoutAFault(later.LaterMutant):
    breaks = ("FieldbusDriver.status/offline", "after re-open")
    found_by = THE_FIELDBUS_AGAIN
    only = "a_lost_node_is_not_operational_and_says_why"
    Fieldbus = later.later(nodes_and_locks_mutants.LostNodeWithoutAFault.Fieldbus)


class LaterStatusFromACache(later.LaterMutant):
    breaks = ("FieldbusDriver.status/status", "after re-open")
    found_by = THE_FIELDBUS_AGAIN
    only = "a_lost_node_is_not_operational_and_says_why"
    Fieldbus = later.later(bus_cells_mutants.StatusFromACache.Fieldbus)


class LaterWritingStopsAxes(later.LaterMutant):
    breaks = ("FieldbusDriver.write_object/nothing-moves", "after re-open")
    found_by = THE_FIELDBUS_AGAIN
    only = "what_does_not_concern_an_axis_leaves_it_alone"
    Fieldbus = later.later(bus_cells_mutants.WritingStopsAxes.Fieldbus)


class LaterWritesTheLowByteOnly(later.LaterMutant):
    breaks = ("FieldbusDriver.write_object/writes", "after re-open")
    found_by = THE_FIELDBUS_AGAIN
    only = "a_written_object_is_in_its_node"
    Fieldbus = later.later(blind_device_mutants.WritesTheLowByteOnly.Fieldbus)


class LaterInputsBlock(later.LaterMutant):
    breaks = ("IoDriver.read_inputs/blocks", "after re-open")
    found_by = IO_AGAIN
    only = "reading_does_not_block"
    Io = later.later(bus_cells_mutants.InputsBlock.Io)


class LaterInputsASecondLate(later.LaterMutant):
    breaks = ("IoDriver.read_inputs/bytes", "after re-open")
    found_by = IO_AGAIN
    only = "each_input_is_at_its_address"
    Io = later.later(blind_device_mutants.InputsASecondLate.Io)


class LaterOutputsBlock(later.LaterMutant):
    breaks = ("IoDriver.read_outputs/blocks", "after re-open")
    found_by = IO_AGAIN
    only = "reading_does_not_block"
    Io = later.later(bus_cells_mutants.OutputsBlock.Io)


class LaterReadOutputsOfTheLastWrite(later.LaterMutant):
    breaks = ("IoDriver.read_outputs/bytes", "after re-open")
    found_by = IO_AGAIN
    only = "bits_are_written_at_the_address_of_each_module"
    Io = later.later(blind_device_mutants.ReadOutputsOfTheLastWrite.Io)


class LaterBitClearsTheNextByte(later.LaterMutant):
    breaks = ("IoDriver.write_output_bit/bit", "after re-open")
    found_by = IO_AGAIN
    only = "bits_are_written_at_the_address_of_each_module"
    Io = later.later(blind_device_mutants.BitClearsTheNextByte.Io)
