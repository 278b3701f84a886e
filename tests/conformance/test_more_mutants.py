"""The checks find every mutant of ``more_mutants``, each by the check of its class."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from tests.conformance import more_mutants as mutants
from tests.conformance.kit import run_kit
from tests.conformance.mutants import Mutant

RAMPS, NEIGHBOURS = "test_ramps.py::test_", "test_neighbours.py::test_"
FEEDBACK, PROCESS = "test_feedback.py::test_", "test_process.py::test_"
BUS, IO, COST = "test_fieldbus.py::test_", "test_io.py::test_", "test_cost.py::test_"
PROFILES, UNITS = "test_profiles.py::test_", "test_units.py::test_"

FOUND_BY: dict[type[Mutant], str] = {
    mutants.StopIgnoredInStreams: RAMPS + "a_stop_ends_a_trajectory",
    mutants.QuickStopIgnoredInStreams: RAMPS + "a_stop_ends_a_trajectory",
    mutants.KeepsPushing: "test_faults.py::test_"
    "a_joint_that_was_blocked_does_not_leap_when_it_is_freed",
    mutants.StopWaits: RAMPS + "a_stop_returns_at_once",
    mutants.QuickStopWaits: RAMPS + "a_stop_returns_at_once",
    mutants.StopByAcceleration: RAMPS + "a_stop_has_the_ramp_of_the_move",
    mutants.StopByFixedRamp: RAMPS + "a_stop_has_the_ramp_of_the_move",
    mutants.StopByFixedRampOfJog: RAMPS + "a_velocity_command_has_the_ramps_of_its_profile",
    mutants.StopTooHard: RAMPS + "a_stop_has_the_ramp_of_the_move",
    mutants.StopOnlyTheFirst: "test_stopping.py::test_a_stopped_move_is_not_complete",
    mutants.StopAndReturn: RAMPS + "an_axis_that_is_stopped_neither_returns_nor_goes_on",
    mutants.StopAndGoOn: RAMPS + "an_axis_that_is_stopped_neither_returns_nor_goes_on",
    mutants.SwappedRamps: RAMPS + "a_move_has_the_ramps_of_its_profile",
    mutants.SwappedRampsOfJog: RAMPS + "a_velocity_command_has_the_ramps_of_its_profile",
    mutants.FixedAcceleration: RAMPS + "a_move_has_the_ramps_of_its_profile",
    mutants.FixedDeceleration: RAMPS + "a_move_has_the_ramps_of_its_profile",
    mutants.FixedVelocity: PROFILES + "a_move_keeps_to_its_velocity",
    mutants.GentleRamps: RAMPS + "a_move_has_the_ramps_of_its_profile",
    mutants.Overshoots: PROFILES + "a_move_ends_at_its_target_without_overshoot",
    mutants.ShortMovesIgnored: RAMPS + "a_short_move_is_made",
    mutants.WrapsTargets: RAMPS + "a_radian_is_a_radian_far_from_zero_and_beyond_a_turn",
    mutants.WrapsPositions: RAMPS + "a_radian_is_a_radian_far_from_zero_and_beyond_a_turn",
    mutants.SmallGain: RAMPS + "a_radian_is_a_radian_far_from_zero_and_beyond_a_turn",
    mutants.Drifts: RAMPS + "a_standing_axis_does_not_drift",
    mutants.NoWatchdog: RAMPS + "an_axis_stops_when_setpoints_stay_away",
    mutants.AlarmEndsAfterAWhile: FEEDBACK + "an_alarm_stays_however_long_it_takes",
    mutants.ClearsAllAlarms: NEIGHBOURS + "the_alarm_of_one_axis_is_cleared_alone",
    mutants.ShortCodes: FEEDBACK + "a_code_is_shown_in_full_with_a_reason",
    mutants.SignedCodes: FEEDBACK + "a_code_is_shown_in_full_with_a_reason",
    mutants.EmptyReason: FEEDBACK + "a_code_is_shown_in_full_with_a_reason",
    mutants.ServoOnClearsAlarms: FEEDBACK + "switching_on_clears_no_alarm",
    mutants.ModeOfAll: NEIGHBOURS + "the_mode_of_one_axis",
    mutants.PolarityOfAll: NEIGHBOURS + "the_polarity_of_one_axis",
    mutants.GearOfAll: NEIGHBOURS + "the_gear_ratio_of_one_axis",
    mutants.HomeOfAll: NEIGHBOURS + "the_home_position_of_one_axis",
    mutants.HomeDoneFromTheStart: NEIGHBOURS + "the_home_position_of_one_axis",
    mutants.StampsGoBack: FEEDBACK + "time_stamps_never_go_back",
    mutants.MeasuresItsCommand: FEEDBACK + "a_blocked_axis_is_measured_where_it_is",
    mutants.MeasuresItsCommandedVelocity: FEEDBACK + "a_blocked_axis_is_measured_where_it_is",
    mutants.CommandsItsMeasurement: FEEDBACK + "a_blocked_axis_is_measured_where_it_is",
    mutants.TorqueBackwards: FEEDBACK
    + "torque_pushes_the_way_the_axis_accelerates_or_is_not_known",
    mutants.TorqueZero: FEEDBACK + "torque_pushes_the_way_the_axis_accelerates_or_is_not_known",
    mutants.InjectorEchoes: FEEDBACK + "a_blocked_axis_is_measured_where_it_is",
    mutants.OutputsInMemoryOnly: IO + "outputs_are_at_the_terminals",
    mutants.OutputsAreInputs: IO + "outputs_are_no_inputs",
    mutants.WritesWhileClosed: IO + "nothing_is_written_while_no_device_is_open",
    mutants.CountersAlwaysZero: BUS + "lost_frames_are_counted_until_a_reset",
    mutants.CountersNeverReset: BUS + "lost_frames_are_counted_until_a_reset",
    mutants.AxesMiscounted: BUS + "the_nodes_have_as_many_axes_as_the_bus",
    mutants.AlwaysOperational: BUS + "a_bus_that_exchanges_nothing_is_not_operational",
    mutants.WrongNodeIsLost: BUS + "the_lost_node_is_the_one_that_was_lost",
    mutants.RegistersConstant: BUS + "registers_differ_from_each_other_and_between_nodes",
    mutants.RegistersOfNodeZero: BUS + "registers_differ_from_each_other_and_between_nodes",
    mutants.ParametersIgnored: "test_connection.py::test_"
    "a_good_parameter_file_is_in_force_axis_by_axis",
    mutants.DumpOfAxisZero: "test_connection.py::test_"
    "a_good_parameter_file_is_in_force_axis_by_axis",
    mutants.ReadsLeaveMemory: PROCESS + "reading_needs_no_memory",
    mutants.SeldomSlowReads: COST + "no_read_of_many_is_slow_or_fails",
    mutants.SeldomFailingReads: COST + "no_read_of_many_is_slow_or_fails",
    mutants.StateWaitsForServos: COST + "state_answers_while_something_slow_runs",
    mutants.SlowClose: PROCESS + "closing_takes_no_time",
    mutants.TakesSignals: PROCESS + "it_is_left_as_it_is",
    mutants.ChangesTheFolder: PROCESS + "it_is_left_as_it_is",
    mutants.ChangesTheLocale: PROCESS + "it_is_left_as_it_is",
    mutants.Prints: PROCESS + "it_is_left_as_it_is",
    mutants.ChangesTheEnvironment: PROCESS + "it_is_left_as_it_is",
}


@pytest.mark.parametrize(
    ("mutant", "check"), [pytest.param(*case, id=case[0].__name__) for case in FOUND_BY.items()]
)
def test_a_mutant_fails_the_check_of_its_class(
    mutant: type[Mutant], check: str, install_mutant: Callable[[type[Mutant]], str]
) -> None:
    outcome = run_kit(install_mutant(mutant), check)
    assert {name.partition("[")[0] for name in outcome.failed} == {check}


def test_every_mutant_is_looked_for() -> None:
    kinds = {kind for kind in vars(mutants).values() if isinstance(kind, type)}
    assert {kind for kind in kinds if issubclass(kind, Mutant)} - {Mutant} == set(FOUND_BY)
