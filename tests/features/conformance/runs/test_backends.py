"""The backends of this repository pass every check."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.features.conformance.runs.conftest import InstallPlugin
from tests.features.conformance.runs.kit import CHECKS, OF_THE_DEVICE, run_kit
from tests.features.conformance.runs.whole_arm import ArmAxes

from robotd.descriptor import list_robots
from robotd_conformance.checks.conftest import SAFE_ORDER

BESIDE_ZERO = Path(__file__).parent / "limits_beside_zero.yaml"
WHOLE_KIT = "cr3a"
# Two joints beside an axis that is none, and wheels.
OTHER_KINDS = (None, "baymax")
OTHERS = sorted({robot.name for robot in list_robots()} - {WHOLE_KIT, *OTHER_KINDS})
MOTION = ("test_profiles.py", "test_stopping.py", "test_trajectories.py", "test_units.py")


def test_the_simulation_passes() -> None:
    outcome = run_kit("sim", robot=WHOLE_KIT)
    assert not outcome.failed
    assert len(outcome.passed) > 90


@pytest.mark.parametrize("robot", OTHER_KINDS)
def test_the_simulation_passes_with_other_kinds_of_robots(robot: str | None) -> None:
    outcome = run_kit("sim", *OF_THE_DEVICE, robot=robot)
    assert not outcome.failed
    assert len(outcome.passed) > 90


@pytest.mark.parametrize("robot", [*OTHERS, str(BESIDE_ZERO)])
def test_the_simulation_moves_every_robot_as_the_kit_asks(robot: str) -> None:
    outcome = run_kit("sim", *MOTION, robot=robot)
    assert not outcome.failed
    assert len(outcome.passed) > 20


def test_a_whole_arm_controller_passes(install_plugin: InstallPlugin) -> None:
    """One servo switch, one alarm for all axes, feedback at 125 Hz, no profiles of its own."""
    outcome = run_kit(install_plugin("WholeArm"))
    assert not outcome.failed
    assert len(outcome.passed) > 80
    assert "test_enable.py::test_only_the_named_servo_is_switched" in outcome.passed
    assert "test_faults.py::test_an_alarm_is_shown_with_its_code" in outcome.passed


@pytest.mark.daily
@pytest.mark.parametrize(
    ("attribute", "value", "check"),
    [
        ("servo_groups", (), "test_enable.py::test_only_the_named_servo_is_switched"),
        ("alarm_text", "", "test_faults.py::test_an_alarm_of_the_controller_is_one_alarm"),
        ("stamps_each_period", True, "test_feedback.py::test_a_time_stamp_is_that_of_its_values"),
        ("max_velocity", 1.0, "test_limits.py::test_a_trajectory_at_the_limits_is_followed"),
    ],
)
def test_a_whole_arm_that_hides_what_it_is_fails(
    attribute: str,
    value: object,
    check: str,
    install_plugin: InstallPlugin,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert check in run_kit(install_plugin("WholeArm"), check).passed
    monkeypatch.setattr(ArmAxes, attribute, value)
    assert check in run_kit("WholeArm", check).failed


@pytest.mark.daily
def test_every_theme_is_there() -> None:
    themes = {path.stem for path in CHECKS.glob("test_*.py")}
    assert themes == {f"test_{theme}" for theme in SAFE_ORDER}
