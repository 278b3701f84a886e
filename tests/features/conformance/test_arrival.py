"""Arrival: how far from its target an axis may rest, and what that does not widen."""

from __future__ import annotations

import numpy as np
import pytest

from robotd.api import AxisLimits, ProcessImage
from robotd_conformance.checks.start_pose import StartPose

NAMES = ["joint1", "joint2"]
LIMITS = [AxisLimits(-3.0, 3.0, 2.0, 4.0), AxisLimits(-3.0, 3.0, 2.0, 4.0)]


def begun(tolerance_rad: float, pose: StartPose | None = None) -> StartPose:
    pose = pose or StartPose()
    pose.begin(np.zeros(2), LIMITS, NAMES, np.array([tolerance_rad, 0.0]))
    return pose


def test_each_axis_has_its_own_tolerance() -> None:
    pose = begun(0.02)
    assert pose.is_start(np.array([0.019, 0.001]))
    assert not pose.is_start(np.array([0.001, 0.019]))


def test_no_tolerance_hides_a_move_that_was_not_made() -> None:
    pose = begun(1.0)
    assert pose.tolerance == pytest.approx([0.03, 2e-3])


def test_a_command_is_at_the_start_pose_however_soft_the_axes_are() -> None:
    pose = begun(0.02)
    assert not pose.is_commanded(np.array([0.003, 0.0]))
    assert pose.is_commanded(np.array([0.001, 0.0]))


def test_a_range_is_not_widened_by_a_tolerance() -> None:
    pose = begun(0.02, StartPose(None, {"joint1": (-0.1, 0.5)}))
    image = ProcessImage(2)
    image.position[:] = 0.503, 0.0
    pose.track(image)
    assert "its --range" in pose.exceeded


def test_the_travel_leaves_room_for_checks_that_go_on_when_they_stop() -> None:
    """The gripper of the so101, at 0, has 0.174 rad to the side of odd axes, less a margin."""
    pose = StartPose()
    limits = [LIMITS[0], AxisLimits(-0.174, 1.745, 2.0, 4.0)]
    pose.begin(np.zeros(2), limits, NAMES, np.zeros(2))
    assert pose.travel(1.0) == pytest.approx([0.3, 0.15])
