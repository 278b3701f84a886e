"""Mutants: further faults from the second connection on: errors, image, stops, scales, bus."""

from __future__ import annotations

from tests.features.conformance.runs.mutants import (
    axis_cells_mutants,
    buffers_mutants,
    bus_cells_mutants,
    cost_mutants,
    foreign_sets_later_mutants,
    foreign_sets_mutants,
    io_and_fieldbus_mutants,
    late_effects_mutants,
    later,
    nodes_and_locks_mutants,
    setpoints_mutants,
    stops_in_every_phase_mutants,
    stream_and_image_cells_mutants,
)

DRY_BUFFERS_AGAIN = "test_again.py::test_dry_buffers_again"
SCALES_AGAIN = "test_again.py::test_scales_again"
SERVOS_AND_ALARMS_AGAIN = "test_again.py::test_servos_and_alarms_again"
STOPS_AGAIN = "test_again.py::test_stops_again"
STREAMS_AGAIN = "test_again.py::test_streams_again"
THE_FIELDBUS_AGAIN = "test_again.py::test_the_fieldbus_again"
VALUES_AGAIN = "test_again.py::test_values_again"
VELOCITY_STREAMS_AGAIN = "test_again.py::test_velocity_streams_again"


class LaterTimeOutsOfTheLibrary(later.LaterMutant):
    breaks = ("drivers/errors", "after re-open")
    found_by = SERVOS_AND_ALARMS_AGAIN
    only = "what_takes_too_long_is_a_time_out"
    Axes = later.later(foreign_sets_mutants.TimeOutsOfTheLibrary.Axes)


class LaterNewArrays(later.LaterMutant):
    breaks = ("AxisDriver.read/in-place", "after re-open")
    found_by = VALUES_AGAIN
    only = "read_fills_the_arrays_that_it_is_given"
    Axes = later.later(cost_mutants.NewArrays.Axes)


class LaterLastAxisIsFrozen(later.LaterMutant):
    breaks = ("AxisDriver.read/fills", "after re-open")
    found_by = VALUES_AGAIN
    only = "a_move_keeps_to_its_velocity"
    Axes = later.later(stream_and_image_cells_mutants.LastAxisIsFrozen.Axes)


class LaterQuickStopDuringAStopIgnored(later.LaterMutant):
    breaks = ("AxisDriver.quick_stop/takes-over", "after re-open")
    found_by = STOPS_AGAIN
    only = "a_quick_stop_of_a_gentle_move_is_quick"
    Axes = later.later(stops_in_every_phase_mutants.QuickStopDuringAStopIgnored.Axes)


class LaterNanInAStreamRaises(later.LaterMutant):
    breaks = ("AxisDriver.stream/nan", "after re-open")
    found_by = VELOCITY_STREAMS_AGAIN
    only = "axes_of_both_modes_stream_together"
    Axes = later.later(stream_and_image_cells_mutants.NanInAStreamRaises.Axes)


class LaterSetpointsAreReadLater(later.LaterMutant):
    breaks = ("AxisDriver.stream/arrays", "after re-open")
    found_by = STREAMS_AGAIN
    only = "setpoints_may_be_overwritten_after_the_call"
    Axes = later.later(setpoints_mutants.SetpointsAreReadLater.Axes)


class LaterDryForGood(later.LaterMutant):
    breaks = ("AxisDriver.stream/underrun", "after re-open")
    found_by = DRY_BUFFERS_AGAIN
    Axes = later.later(buffers_mutants.DryForGood.Axes)


class LaterDryWithoutAWord(later.LaterMutant):
    breaks = ("AxisDriver.stream_ran_dry/dry", "after re-open")
    found_by = DRY_BUFFERS_AGAIN
    Axes = later.later(buffers_mutants.DryWithoutAWord.Axes)


class LaterTorqueModeThatIsNotThere(later.LaterMutant):
    breaks = ("AxisDriver.set_command_mode/undeclared", "after re-open")
    found_by = SERVOS_AND_ALARMS_AGAIN
    only = "the_driver_takes_no_mode_that_is_not_declared"
    Axes = later.later(foreign_sets_later_mutants.TorqueModeThatIsNotThere.Axes)


class LaterPolarityOfAnEnabledAxis(later.LaterMutant):
    breaks = ("AxisDriver.set_polarity/servo-off", "after re-open")
    found_by = SCALES_AGAIN
    only = "the_scale_of_an_enabled_axis_is_not_changed"
    Axes = later.later(axis_cells_mutants.PolarityOfAnEnabledAxis.Axes)


class LaterGearRatioOfAnEnabledAxis(later.LaterMutant):
    breaks = ("AxisDriver.set_gear_ratio/servo-off", "after re-open")
    found_by = SCALES_AGAIN
    only = "the_scale_of_an_enabled_axis_is_not_changed"
    Axes = later.later(axis_cells_mutants.GearRatioOfAnEnabledAxis.Axes)


class LaterPolarityIsMeasuredLater(later.LaterMutant):
    breaks = ("AxisDriver.set_polarity/measured", "after re-open")
    found_by = SCALES_AGAIN
    only = "polarity_is_set_and_not_toggled"
    Axes = later.later(late_effects_mutants.PolarityIsMeasuredLater.Axes)


class LaterRegistersRemembered(later.LaterMutant):
    breaks = ("FieldbusDriver.read_register/now", "after re-open")
    found_by = THE_FIELDBUS_AGAIN
    only = "registers_show_that_the_exchange_has_ended"
    Fieldbus = later.later(nodes_and_locks_mutants.RegistersRemembered.Fieldbus)


class LaterRejectedWriteIsSilent(later.LaterMutant):
    breaks = ("FieldbusDriver.write_object/errors", "after re-open")
    found_by = THE_FIELDBUS_AGAIN
    only = "an_object_that_the_node_does_not_have_is_an_error_without_effect"
    Fieldbus = later.later(bus_cells_mutants.RejectedWriteIsSilent.Fieldbus)


class LaterAlwaysOperational(later.LaterMutant):
    breaks = ("FieldbusDriver.status/states", "after re-open")
    found_by = "test_fieldbus.py::test_a_bus_that_exchanges_nothing_is_not_operational"
    Fieldbus = later.later(io_and_fieldbus_mutants.AlwaysOperational.Fieldbus)
