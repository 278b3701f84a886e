"""The checks bite: every mutant fails the check that names its fault."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest
from tests.conformance import mutants
from tests.conformance.kit import run_kit
from tests.conformance.mutants import Mutant

UNITS, PROFILES = "test_units.py::test_", "test_profiles.py::test_"
PATHS = "test_trajectories.py::test_"
STOPPING, ENABLE = "test_stopping.py::test_", "test_enable.py::test_"
LIFE = "test_connection.py::test_"
FAULTS, COST = "test_faults.py::test_", "test_cost.py::test_"

FAULTY: list[tuple[type[Mutant], str, str]] = [
    (mutants.SignFlipped, UNITS + "a_commanded_radian_is_a_measured_radian", "position"),
    (mutants.Degrees, UNITS + "a_commanded_radian_is_a_measured_radian", "position|at rest"),
    (mutants.MirroredThroughout, UNITS + "the_measured_position_is_that_of_the_shaft", "approx"),
    (mutants.StreamedDegrees, UNITS + "a_streamed_radian_is_a_measured_radian", "position"),
    (mutants.TurnsPerMinute, UNITS + "the_velocity_is_the_slope_of_the_position", "measured"),
    (mutants.AxesSwapped, UNITS + "each_axis_moves_alone", "position"),
    (mutants.JogsBackwards, UNITS + "a_positive_velocity_raises_the_position", "velocity"),
    (mutants.TooFast, PROFILES + "a_move_keeps_to_its_velocity", "limit"),
    (mutants.TooFast, PROFILES + "a_second_is_a_second", "took_s"),
    (mutants.TooSteep, PROFILES + "a_move_keeps_to_its_ramps", "acceleration"),
    (mutants.JumpsToNewTargets, PROFILES + "a_new_target_is_taken_without_a_jump", "acceleration"),
    (mutants.StopThatDoesNotStop, STOPPING + "a_stop_takes_the_time_and_way_of_its_ramp", "ramp_s"),
    (mutants.QuickStopThatCoasts, STOPPING + "a_quick_stop_is_no_slower_than_a_stop", "quick"),
    (mutants.StopsEverything, STOPPING + "a_stop_leaves_other_axes_alone", "targets"),
    (mutants.JumpAtEnable, ENABLE + "enabling_after_a_move_by_hand_does_not_jump", "start"),
    (mutants.ServoThatLies, ENABLE + "servo_returns_when_the_drive_says_so", "servo_on"),
    (mutants.EnablesByItself, LIFE + "starting_enables_and_moves_nothing", "servo"),
    (
        mutants.SaysItStands,
        PATHS + "no_joint_leaps_after_the_cycle_has_stood",
        "rad/s on a path of",
    ),
    (
        mutants.SaysItStands,
        "test_underrun.py::test_an_axis_without_setpoints_does_what_underrun_says",
        "without setpoints",
    ),
    (mutants.SpringsBack, PATHS + "a_trajectory_arrives", "position"),
    (mutants.StaleValues, "test_ageing.py::test_values_follow_the_motion", "stale_s"),
    (mutants.AlwaysFresh, "test_ageing.py::test_a_dead_bus_does_not_look_alive", "not ready"),
    (mutants.AnotherClock, "test_ageing.py::test_values_are_fresh", "another clock|ready|stale"),
    (mutants.SwallowedFault, FAULTS + "an_alarm_is_shown_with_its_code", "the alarm is shown"),
    (
        mutants.HealsItself,
        FAULTS + "an_alarm_stays_until_it_is_cleared_and_then_nothing_moves",
        "went away by itself",
    ),
    (
        mutants.ReasonThatStays,
        FAULTS + "the_reason_of_an_alarm_comes_and_goes_with_it",
        "goes with the alarm",
    ),
    (
        mutants.FaultThatBlocks,
        "test_ageing.py::test_the_device_says_at_once_why_it_is_silent",
        "blocks",
    ),
    (
        mutants.ClearingEnables,
        FAULTS + "an_alarm_stays_until_it_is_cleared_and_then_nothing_moves",
        "enabled the servo",
    ),
    (
        mutants.StartsLater,
        LIFE + "a_start_that_times_out_is_undone",
        "after a start that failed",
    ),
    (
        mutants.RescalesLiveAxes,
        LIFE + "a_load_changes_no_scale_of_a_live_axis",
        "DID NOT RAISE",
    ),
    (
        mutants.DefaultsForAbsentAxes,
        LIFE + "a_parameter_file_without_axes_of_the_robot_is_refused",
        "DID NOT RAISE",
    ),
    (mutants.StateThatLies, LIFE + "the_states_follow_the_calls", "RUNNING"),
    (mutants.BlockingRead, COST + "read_does_not_block", "read takes"),
    (mutants.NowAndThenBlockingRead, COST + "read_does_not_block", "99 of 100"),
    (mutants.NewArrays, COST + "read_fills_the_arrays_that_it_is_given", "arrays"),
    (
        mutants.OneCallerAtATime,
        "test_threads.py::test_switching_servos_does_not_disturb_the_cycle",
        "called by two threads",
    ),
    (
        mutants.LocksTheCycleOut,
        "test_threads.py::test_switching_servos_does_not_disturb_the_cycle",
        "held up the cycle|not ready",
    ),
    (mutants.LeakedThread, "test_leaks.py::test_no_thread_is_left", "forgotten"),
    (mutants.LeakedHandle, "test_leaks.py::test_no_handle_is_left", "/dev/null"),
    (mutants.NeighboursClobbered, "test_io.py::test_a_bit_leaves_its_neighbours_alone", "outputs"),
    (
        mutants.BitsGetLost,
        "test_io.py::test_bits_written_by_several_threads_are_all_there",
        "outputs from byte",
    ),
    (mutants.Boaster, "test_rejections.py::test_what_is_declared_is_there", "register_read"),
]


@pytest.mark.parametrize(
    ("mutant", "check", "says"),
    [
        pytest.param(*case, id=f"{case[0].__name__}-{case[1].partition('::test_')[2]}")
        for case in FAULTY
    ],
)
def test_a_mutant_fails_the_check_that_names_its_fault(
    mutant: type[Mutant], check: str, says: str, install_mutant: Callable[[type[Mutant]], str]
) -> None:
    outcome = run_kit(install_mutant(mutant), check)
    assert set(outcome.failed) == {check}
    assert re.search(says, outcome.failed[check])


def test_every_mutant_is_checked() -> None:
    kinds = {kind for kind in vars(mutants).values() if isinstance(kind, type)}
    faulty = {kind for kind in kinds if issubclass(kind, Mutant) and kind is not Mutant}
    assert faulty == {case[0] for case in FAULTY}
