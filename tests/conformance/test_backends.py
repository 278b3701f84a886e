"""The backends of this repository pass every check."""

from __future__ import annotations

import pytest
from tests.conformance.conftest import InstallPlugin
from tests.conformance.kit import CHECKS, run_kit
from tests.conformance.whole_arm import ArmAxes


@pytest.mark.parametrize("robot", [None, "cr3a", "standalone", "baymax"])
def test_the_simulation_passes(robot: str | None) -> None:
    outcome = run_kit("sim", robot=robot)
    assert not outcome.failed
    assert len(outcome.passed) > 90


def test_a_whole_arm_controller_passes(install_plugin: InstallPlugin) -> None:
    """One servo switch, one alarm for all axes, feedback at 125 Hz, no profiles of its own."""
    outcome = run_kit(install_plugin("WholeArm"))
    assert not outcome.failed
    assert len(outcome.passed) > 80
    assert "test_enable.py::test_only_the_named_servo_is_switched" in outcome.passed
    assert "test_faults.py::test_an_alarm_is_shown_with_its_code" in outcome.passed


@pytest.mark.parametrize("switch", [None, "servo_groups"])
def test_a_whole_arm_that_hides_its_servo_group_fails(
    switch: str | None, install_plugin: InstallPlugin, monkeypatch: pytest.MonkeyPatch
) -> None:
    if switch:
        monkeypatch.setattr(ArmAxes, switch, ())
    check = "test_enable.py::test_only_the_named_servo_is_switched"
    assert set(run_kit(install_plugin("WholeArm"), check).failed) == ({check} if switch else set())


def test_every_theme_is_there() -> None:
    themes = {path.stem for path in CHECKS.glob("test_*.py")}
    assert len(themes) == 21
