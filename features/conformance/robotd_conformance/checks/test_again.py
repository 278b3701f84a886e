"""Checks once more: after alarms, a pause of communication, and in a second connection."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from typing import Any

import pytest

from robotd.api import Capability, CommandMode, NotReady, RobotdError, Unsupported
from robotd_conformance.checks import (
    test_axes_apart,
    test_bus_objects,
    test_command_sequences,
    test_cost,
    test_dry_buffers,
    test_enable,
    test_faults,
    test_feedback,
    test_fieldbus,
    test_io,
    test_io_images,
    test_last_axis,
    test_lost_nodes,
    test_overrides,
    test_parameters,
    test_profiles,
    test_questions,
    test_ramps,
    test_rejections,
    test_scale_and_home,
    test_scaling,
    test_setpoints,
    test_small_and_large,
    test_stop_ramps,
    test_stopping,
    test_stops_of_some_axes,
    test_streams,
    test_switches,
    test_units,
    test_velocity_commands,
    test_whole_streams,
)
from robotd_conformance.checks.harness import Harness

ALARM = 0x32
EVENTS = "in a second connection, after an alarm of each axis and a pause of communication"
GATES = ("needs", "short_period", "free_space")  # marks that leave a check out

Check = Callable[..., None]
Given = Callable[[Check], dict[str, Any]]
CASES: dict[Check, dict[str, Any]] = {
    test_command_sequences.test_a_quick_stop_of_a_gentle_move_is_quick: {"phase": "at a stop"},
    test_whole_streams.test_setpoints_may_be_overwritten_after_the_call: {
        "mode": CommandMode.VELOCITY
    },
}
"""Parameters that show more than the first ones."""


@pytest.fixture
def outputs(fresh: Harness) -> Iterator[None]:
    """Puts outputs back in the end."""
    driver = fresh.drivers.io
    before = driver.read_outputs(0, driver.output_bytes) if driver is not None else b""
    yield
    if driver is not None and before:
        with suppress(RobotdError):  # the check may have failed on a closed device
            driver.write_outputs(0, before)


@pytest.fixture
def given(fresh: Harness, outputs: None, request: pytest.FixtureRequest) -> Given:
    """Function that returns the arguments of a check, whose fixtures it sets up on ``fresh``."""

    def disabled() -> Harness:
        fresh.disable()
        return fresh

    def streamed() -> Harness:
        if fresh.robot.axes.trajectories_on_device:
            pytest.skip("positions are not streamed: trajectories run on the device")
        return fresh

    def stepped() -> Harness:
        if not fresh.stepped:
            pytest.skip("single setpoints are judged in simulated time")
        return streamed()

    def rescalable() -> Harness:
        fresh.require_rescaling()
        fresh.move_all()
        fresh.rest()
        return disabled()

    def last() -> int:
        if fresh.count < 2:
            pytest.skip(f"the robot {fresh.robot.descriptor.name} has one axis")
        return fresh.count - 1

    makers: dict[str, Callable[[], Any]] = {
        "harness": lambda: fresh,
        "fresh": lambda: fresh,
        "disabled": disabled,
        "streamed": streamed,
        "stepped": stepped,
        "rescalable": rescalable,
        "last": last,
        "stop": lambda: lambda driver, axes: driver.stop(axes),
        "injector": lambda: fresh.injector,
        "io": lambda: test_io.io_of(fresh),
        "tmp_path": partial(request.getfixturevalue, "tmp_path"),
    }

    def arguments(check: Check) -> dict[str, Any]:
        first = parameters(check)
        names = [name for name in inspect.signature(check).parameters if name not in first]
        return first | {name: makers[name]() for name in names}

    return arguments


def marks(check: Check) -> list[pytest.Mark]:
    """Return the marks of a check, then those of its module."""
    module = vars(sys.modules[check.__module__]).get("pytestmark", [])
    own = vars(check).get("pytestmark", [])
    whole = module if isinstance(module, list) else [module]
    return [*own, *(mark.mark for mark in whole)]


def parameters(check: Check) -> dict[str, Any]:
    """Return the first parameters of a check, or its ``CASES``: not each case comes again."""
    first = {}
    for mark in marks(check):
        if mark.name == "parametrize":
            name, values = mark.args
            first[name] = getattr(values[0], "values", values)[0]
    return first | CASES.get(check, {})


def checks(*chosen: Check) -> pytest.MarkDecorator:
    """Parameters ``check``: each is left out where it is left out by itself."""
    params = []
    for check in chosen:
        gates = [getattr(pytest.mark, mark.name)(*mark.args) for mark in gates_of(check)]
        params.append(pytest.param(check, id=check.__name__.removeprefix("test_"), marks=gates))
    return pytest.mark.parametrize("check", params)


def gates_of(check: Check) -> list[pytest.Mark]:
    by_name = {mark.name: mark for mark in reversed(marks(check)) if mark.name in GATES}
    return list(by_name.values())


def again(fresh: Harness, given: Given, check: Check) -> None:
    """Run ``check``, let everything happen that it has to survive, and run it again."""
    if not fresh.stepped and any(mark.name == "short_period" for mark in marks(check)):
        pytest.skip("ramps are judged once in real time, by the check that is repeated here")
    check(**given(check))
    go_through_events(fresh)
    try:
        check(**given(check))
    except AssertionError as error:
        raise AssertionError(f"{EVENTS}: {error}") from error


def go_through_events(harness: Harness) -> None:
    """Leave the axes enabled, at rest at their start pose."""
    connection, injector = harness.robot.connection, harness.fault_injector
    harness.undo_faults()
    bus = harness.drivers.fieldbus
    if bus is not None and harness.can(Capability.HOT_CONNECT):
        for number in range(bus.buses):  # a drive may be lost
            with suppress(NotReady):  # without communication, which begins below
                bus.start_hot_connect(number)
    elif harness.image.offline.any():
        pytest.skip(f"the {harness.robot.backend.name} backend takes no drive in again")
    connection.close()
    harness.start()
    for axis in harness.all:
        with suppress(Unsupported):
            if injector is not None:
                injector.trip(axis, ALARM)
                shown = partial(shows_alarm, harness, axis)
                harness.until(shown, f"the alarm of axis {axis} is shown", 1.0)
        harness.robot.axes.clear_alarm(axis)
    connection.stop_communication()
    harness.start()


def shows_alarm(harness: Harness, axis: int) -> bool:
    return bool(harness.image.amp_alarm[axis])


@pytest.mark.clause("drivers/units", "AxisDriver/as-commanded", "AxisDriver.move/target")
@pytest.mark.clause("AxisDriver.move/profile", "AxisDriver.move/overrides")
@pytest.mark.clause("AxisDriver.move/new-profile", "AxisDriver.move/while-stopping")
@checks(
    test_units.test_a_commanded_radian_is_a_measured_radian,
    test_small_and_large.test_small_moves_add_up,
    test_overrides.test_a_move_that_overrides_another_has_its_own_ramps,
    test_overrides.test_a_move_during_a_stop_is_rejected_or_made,
)
def test_moves_again(fresh: Harness, given: Given, check: Check) -> None:
    again(fresh, given, check)


@pytest.mark.clause("AxisDriver.stop/all-axes", "AxisDriver.stop/idle", "AxisDriver.stop/again")
@pytest.mark.clause("AxisDriver.stop/returns", "AxisDriver.quick_stop/takes-over")
@pytest.mark.clause("AxisDriver.quick_stop/idle", "AxisDriver.quick_stop/returns")
@checks(
    test_stop_ramps.test_a_stop_of_moving_and_idle_axes_stops_all_that_move,
    test_stopping.test_a_stop_of_a_standing_axis_has_no_effect,
    test_stops_of_some_axes.test_a_repeated_stop_changes_nothing,
    test_command_sequences.test_a_stop_does_not_prolong_a_quick_stop,
    test_command_sequences.test_a_quick_stop_of_a_gentle_move_is_quick,
    test_ramps.test_a_stop_returns_at_once,
)
def test_stops_again(fresh: Harness, given: Given, check: Check) -> None:
    again(fresh, given, check)


@pytest.mark.clause("AxisDriver.jog/new-profile", "AxisDriver.jog/changes")
@pytest.mark.clause("AxisDriver.jog/profile", "AxisDriver.jog/zero")
@checks(
    test_overrides.test_each_change_of_a_velocity_command_has_its_own_ramps,
    test_small_and_large.test_each_velocity_command_has_its_own_ramps,
)
def test_velocity_commands_again(fresh: Harness, given: Given, check: Check) -> None:
    again(fresh, given, check)


@pytest.mark.clause("AxisDriver.begin_stream/again", "AxisDriver.begin_stream/all")
@pytest.mark.clause("AxisDriver.begin_stream/modes", "AxisDriver.stream/late")
@pytest.mark.clause("AxisDriver.stream/velocity", "AxisDriver.stream/nan")
@pytest.mark.clause("AxisDriver.stream/arrays", "AxisDriver.end_stream/holds")
@pytest.mark.clause("AxisDriver.end_stream/velocity", "AxisDriver.end_stream/reached")
@pytest.mark.clause("AxisDriver.end_stream/idle")
@checks(
    test_axes_apart.test_a_stream_of_an_axis_that_is_off_begins_for_none,
    test_axes_apart.test_enabling_changes_no_kind_of_motion,
    test_streams.test_groups_of_axes_stream_by_themselves,
    test_setpoints.test_a_setpoint_that_was_too_late_has_no_effect,
    test_setpoints.test_a_stream_ends_on_its_last_setpoint,
    test_whole_streams.test_setpoints_may_be_overwritten_after_the_call,
)
def test_streams_again(fresh: Harness, given: Given, check: Check) -> None:
    again(fresh, given, check)


@pytest.mark.clause("AxisDriver.begin_stream/modes", "AxisDriver.stream/velocity")
@pytest.mark.clause("AxisDriver.stream/nan", "AxisDriver.end_stream/velocity")
@checks(
    test_whole_streams.test_axes_of_both_modes_stream_together,
    test_velocity_commands.test_a_velocity_stream_that_ends_slows_to_rest,
    test_setpoints.test_a_streamed_velocity_changes_evenly,
)
def test_velocity_streams_again(fresh: Harness, given: Given, check: Check) -> None:
    again(fresh, given, check)


@pytest.mark.clause("AxisDriver.stream_ran_dry/dry", "AxisDriver.stream/underrun")
@checks(test_dry_buffers.test_buffers_that_ran_dry_in_motion_are_reported)
def test_dry_buffers_again(fresh: Harness, given: Given, check: Check) -> None:
    again(fresh, given, check)


@pytest.mark.clause("AxisDriver.servo/waits", "AxisDriver.servo/enabled")
@pytest.mark.clause("AxisDriver.clear_alarm/waits", "AxisDriver.clear_alarm/idle")
@pytest.mark.clause("drivers/errors", "AxisDriver.set_command_mode/undeclared")
@checks(
    test_enable.test_servo_returns_when_the_drive_says_so,
    test_enable.test_enabling_an_axis_in_motion_changes_nothing,
    test_enable.test_what_takes_too_long_is_a_time_out,
    test_last_axis.test_an_alarm_of_the_last_axis,
    test_last_axis.test_clearing_without_an_alarm_disturbs_no_motion,
    test_enable.test_a_disabled_axis_refuses_to_move,
    test_rejections.test_the_driver_takes_no_mode_that_is_not_declared,
)
def test_servos_and_alarms_again(fresh: Harness, given: Given, check: Check) -> None:
    again(fresh, given, check)


@pytest.mark.clause("AxisDriver.read/fills", "AxisDriver.read/in-place")
@pytest.mark.clause("AxisDriver.read/complete")
@pytest.mark.clause("AxisDriver.read/switches", "AxisDriver.read/reason", "AxisDriver.read/taken")
@pytest.mark.clause("AxisDriver.read/nan", "AxisDriver.read/torque", "AxisDriver.read/controller")
@pytest.mark.clause("AxisDriver.confirmed_off/confirmed", "AxisDriver.confirmed_off/after")
@checks(
    test_cost.test_read_fills_the_arrays_that_it_is_given,
    test_profiles.test_a_move_shows_what_it_does,
    test_profiles.test_a_move_keeps_to_its_velocity,
    test_switches.test_a_closed_switch_is_shown_alone_until_it_is_released,
    test_faults.test_the_reason_of_an_alarm_comes_and_goes_with_it,
    test_faults.test_an_alarm_of_the_controller_is_one_alarm,
    test_feedback.test_a_time_stamp_is_that_of_its_values,
    test_feedback.test_torque_pushes_the_way_the_axis_accelerates_or_is_not_known,
    test_feedback.test_torque_is_in_newton_metres,
    test_lost_nodes.test_a_drive_is_confirmed_to_be_off_where_it_answers,
)
def test_values_again(fresh: Harness, given: Given, check: Check) -> None:
    again(fresh, given, check)


@pytest.mark.clause("AxisDriver.set_polarity/sets", "AxisDriver.set_polarity/servo-off")
@pytest.mark.clause("AxisDriver.set_polarity/measured", "AxisDriver.set_polarity/ratio")
@pytest.mark.clause("AxisDriver.set_gear_ratio/counts", "AxisDriver.set_gear_ratio/servo-off")
@pytest.mark.clause("AxisDriver.set_gear_ratio/polarity")
@checks(
    test_scale_and_home.test_polarity_and_gear_ratio_leave_each_other_alone,
    test_scaling.test_polarity_is_set_and_not_toggled,
    test_scaling.test_a_gear_ratio_is_a_fraction,
    test_scaling.test_the_scale_of_an_enabled_axis_is_not_changed,
)
def test_scales_again(fresh: Harness, given: Given, check: Check) -> None:
    again(fresh, given, check)


@pytest.mark.clause("AxisDriver.home/zero", "AxisDriver.home/waits", "AxisDriver.home/command")
@pytest.mark.clause("AxisDriver.home/servo-off")
@checks(
    test_scaling.test_homing_again_makes_the_new_position_zero,
    test_scale_and_home.test_the_command_is_zero_after_homing_too,
    test_scale_and_home.test_homing_with_the_servo_off_is_done_or_rejected,
)
def test_homing_again(fresh: Harness, given: Given, check: Check) -> None:
    fresh.require_rescaling()
    again(fresh, given, check)


@pytest.mark.clause("DeviceDriver.load_parameters/kept", "DeviceDriver.load_parameters/note")
@pytest.mark.clause("DeviceDriver.load_parameters/live", "DeviceDriver.load_parameters/named")
@pytest.mark.clause("DeviceDriver.load_parameters/wrong-file", "DeviceDriver.dump_parameters/scale")
@pytest.mark.clause("DeviceDriver.dump_parameters/text", "AxisDriver.home/scale")
@checks(
    test_parameters.test_a_dump_shows_what_is_changed_at_run_time,
    test_parameters.test_a_load_that_one_axis_forbids_changes_no_other,
    test_parameters.test_each_load_is_in_force_also_after_communication_stopped,
    test_parameters.test_a_wrong_value_of_the_last_axis_changes_no_axis,
    test_parameters.test_a_note_says_what_a_file_leaves_out,
    test_scale_and_home.test_homing_leaves_the_scale_alone,
)
def test_parameters_again(fresh: Harness, given: Given, check: Check) -> None:
    again(fresh, given, check)


@pytest.mark.clause("IoDriver.read_inputs/bytes", "IoDriver.read_inputs/blocks")
@pytest.mark.clause("IoDriver.read_outputs/bytes", "IoDriver.read_outputs/blocks")
@pytest.mark.clause("IoDriver.write_outputs/bytes", "IoDriver.write_output_bit/bit")
@checks(
    test_io.test_each_input_is_at_its_address,
    test_io.test_each_output_byte_is_at_its_address,
    test_io.test_reading_does_not_block,
    test_io_images.test_bits_are_written_at_the_address_of_each_module,
)
def test_io_again(fresh: Harness, given: Given, check: Check) -> None:
    again(fresh, given, check)


@pytest.mark.clause("FieldbusDriver.status/status", "FieldbusDriver.status/offline")
@pytest.mark.clause("FieldbusDriver.reset_statistics/zero", "FieldbusDriver.read_register/memory")
@pytest.mark.clause("FieldbusDriver.read_register/now", "FieldbusDriver.read_object/value")
@pytest.mark.clause("FieldbusDriver.read_object/now", "FieldbusDriver.read_object/errors")
@pytest.mark.clause("FieldbusDriver.write_object/writes", "FieldbusDriver.write_object/errors")
@pytest.mark.clause(
    "FieldbusDriver.write_object/nothing-moves", "DeviceDriver.scan_network/summary"
)
@checks(
    test_lost_nodes.test_a_lost_node_is_not_operational_and_says_why,
    test_fieldbus.test_a_lost_drive_is_missing_in_a_scan,
    test_fieldbus.test_lost_frames_are_counted_until_a_reset,
    test_fieldbus.test_registers_differ_from_each_other_and_between_nodes,
    test_fieldbus.test_objects_are_read_from_the_node_that_was_asked,
    test_fieldbus.test_an_object_that_the_node_does_not_have_is_an_error_without_effect,
    test_fieldbus.test_a_written_object_is_in_its_node,
    test_questions.test_what_does_not_concern_an_axis_leaves_it_alone,
    test_bus_objects.test_registers_show_that_the_exchange_has_ended,
)
def test_the_fieldbus_again(fresh: Harness, given: Given, check: Check) -> None:
    again(fresh, given, check)
