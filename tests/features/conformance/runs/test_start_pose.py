"""Each check returns to the start pose of the run, and a run that goes astray ends."""

from __future__ import annotations

import numpy as np
import pytest
from tests.features.conformance.runs.conftest import InstallPlugin
from tests.features.conformance.runs.kept_pose import (
    CARRIED,
    Astray,
    Carries,
    GivesWay,
    Hardware,
    KeptPose,
    NearLimit,
)
from tests.features.conformance.runs.kit import run_kit

MOVING = ("test_units.py", "test_stopping.py", "test_profiles.py", "test_trajectories.py")


@pytest.fixture(autouse=True)
def fresh_controllers(monkeypatch: pytest.MonkeyPatch) -> None:
    for plugin in (KeptPose, NearLimit, Hardware, Carries, GivesWay, Astray):
        monkeypatch.setattr(plugin, "position", None)


@pytest.mark.parametrize("plugin", [KeptPose, NearLimit])
def test_a_controller_that_keeps_its_pose_passes_wherever_it_was_left(
    install_plugin: InstallPlugin, plugin: type[KeptPose]
) -> None:
    outcome = run_kit(install_plugin(plugin.__name__), *MOVING)
    assert outcome.failed == {}
    assert len(outcome.passed) > 20
    assert plugin.position == pytest.approx(np.full(3, plugin.start_rad), abs=0.31)


@pytest.mark.parametrize("allowed", [1.3, 0.0], ids=["passes", "fails"])
def test_hardware_is_left_at_its_start_pose(
    install_plugin: InstallPlugin, monkeypatch: pytest.MonkeyPatch, allowed: float
) -> None:
    monkeypatch.setattr("robotd_conformance.checks.test_stopping.MORE", allowed)
    if not allowed:
        monkeypatch.setattr("robotd_conformance.checks.test_stopping.REACTION_S", 0.0)
    ramp = "test_stopping.py::test_a_stop_takes_the_time_and_distance_of_its_ramp"
    own_device = "test_process.py::test_a_forked_process_does_not_disturb_the_device"
    outcome = run_kit(install_plugin("Hardware"), ramp, own_device)
    unfit = outcome.failed | outcome.inconclusive  # a busy computer shares the blame
    assert (ramp in unfit) is (allowed == 0.0)
    assert not outcome.ended_early
    assert Hardware.position == pytest.approx(np.zeros(3), abs=2e-3)


def test_a_run_on_hardware_that_goes_astray_is_stopped_and_ends(
    install_plugin: InstallPlugin, capsys: pytest.CaptureFixture[str]
) -> None:
    outcome = run_kit(install_plugin("Astray"), "test_units.py")
    assert outcome.ended_early
    assert len(outcome.failed) == 1
    assert "from its start pose; --max-excursion is 0.45 rad !" in capsys.readouterr().out
    assert Astray.position is not None
    assert np.abs(Astray.position).max() < 0.75, "0.9 rad is where it goes without a stop"


def test_a_run_ends_at_once_where_an_axis_begins_outside_of_its_range(
    capsys: pytest.CaptureFixture[str],
) -> None:
    outcome = run_kit("sim", "test_units.py", robot="cr3a", options=["--robotd-range=joint1=0.5:1"])
    assert outcome.ended_early
    assert outcome.failed == {}
    assert len(outcome.refused) == 1
    assert "joint1 is at 0.000 rad, outside of its --range" in capsys.readouterr().out


def test_an_arm_that_gives_way_arrives_within_the_goal_tolerance_of_its_file(
    install_plugin: InstallPlugin,
) -> None:
    moves = [
        f"test_units.py::{name}"
        for name in ("test_a_commanded_radian_is_a_measured_radian", "test_each_axis_moves_alone")
    ]
    backend = install_plugin("GivesWay")
    stated = "--robotd-set=trajectory.goal_tolerance_rad=0.01"
    outcome = run_kit(backend, *moves, "test_profiles.py", options=[stated])
    assert outcome.failed == {}
    assert len(outcome.passed) > 5
    without = run_kit(backend, *moves)  # the default of 0.01 rad is not a statement
    assert "not back at the start pose" in str(without.failed)


def test_on_hardware_no_payload_is_set_but_the_one_that_is_carried(
    install_plugin: InstallPlugin,
) -> None:
    Carries.payloads.clear()
    outcome = run_kit(install_plugin("Carries"), "test_payload.py")
    assert outcome.failed == {}
    assert len(outcome.passed) > 3
    assert set(Carries.payloads) == {CARRIED}
