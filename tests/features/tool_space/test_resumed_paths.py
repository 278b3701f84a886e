"""Arcs, paths whose samples are solved at once, and motion that goes on from where it ended."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from tests.features.tool_space.test_lines import SPEED, STARTS, WAYS, Arm

from robotd.api import FloatArray, InvalidArgument
from robotd_tool_space import Kinematics, Unreachable
from robotd_tool_space.paths.joint_path import JointPath, solve_at_once, solve_path
from robotd_tool_space.paths.segments import Arc
from robotd_tool_space.paths.tool_curves import LineCurve
from robotd_tool_space.paths.tool_motion import (
    ToolMotion,
    place_on,
    plan_fast_motion,
    positions_at,
    rest_of,
    rest_of_lines,
)
from robotd_tool_space.paths.tool_path import ToolPath
from robotd_tool_space.sequences.sequence_plan import LINE_TOLERANCE_M


def line_path(arm: Arm, end: FloatArray) -> ToolPath:
    return ToolPath.of([LineCurve.to(arm.pose, end, SPEED)], [])


def dense(motion: ToolMotion, count: int = 2000) -> FloatArray:
    """Positions of a motion, by other code than that which plans."""
    spline = CubicHermiteSpline(motion.times_s, motion.positions, motion.velocities)
    return np.asarray(spline(np.linspace(0.0, motion.duration_s, count)))


def outcome(
    solve: Callable[[Kinematics, ToolPath, FloatArray], JointPath], arm: Arm, path: ToolPath
) -> FloatArray | str:
    """Positions along a path, or the reason why there are none."""
    try:
        return solve(arm.kinematics, path, arm.start).positions
    except Unreachable as error:
        return str(error)


@pytest.mark.parametrize("name", STARTS)
def test_samples_solved_at_once_are_those_solved_one_after_the_other(name: str) -> None:
    arm = Arm(name)
    path = line_path(arm, arm.moved(*WAYS[name]))
    expected = solve_path(arm.kinematics, path, arm.start)
    found = solve_at_once(arm.kinematics, path, arm.start)
    assert found.positions == pytest.approx(expected.positions, abs=1e-6)
    assert found.slopes == pytest.approx(expected.slopes, abs=1e-4)


def test_ways_that_cannot_be_followed_are_refused_for_the_same_reason() -> None:
    arm, random = Arm("cr3a"), np.random.default_rng(3)
    refused = 0
    for displacement in random.uniform(-0.3, 0.3, (8, 3)).tolist():
        path = line_path(arm, arm.moved(displacement))
        expected, found = (outcome(solve, arm, path) for solve in (solve_path, solve_at_once))
        if isinstance(expected, str):
            refused += 1
            assert found == expected
        else:
            assert found == pytest.approx(expected, abs=1e-6)
    assert 0 < refused < 8


@pytest.mark.parametrize("turn", [0.3, 2.0, 4.0, 6.0])
def test_an_arc_is_on_its_circle(turn: float) -> None:
    arm, radius = Arm("cr3a"), 0.06
    centre = arm.pose[:3, 3] + [0.0, 0.0, radius]

    def at(angle: float) -> FloatArray:
        displacement = (
            centre - arm.pose[:3, 3] + radius * np.array([0.0, np.sin(angle), -np.cos(angle)])
        )
        return arm.moved(displacement.tolist())

    motion = arm.plan_segments(Arc(at(0.4 * turn), at(turn)))
    places = arm.kinematics.forward(dense(motion))[:, :3, 3] - centre
    assert np.linalg.norm(places, axis=1) == pytest.approx(radius, abs=LINE_TOLERANCE_M)
    assert places[:, 0] == pytest.approx(0.0, abs=1e-5)
    angles = np.unwrap(np.arctan2(places[:, 1], -places[:, 2]))
    assert angles[-1] == pytest.approx(turn, abs=1e-4)
    assert (np.diff(angles) >= -1e-6).all()


def test_an_arc_through_places_that_make_none_is_refused() -> None:
    arm = Arm("cr3a")
    up, more = arm.moved([0.0, 0.0, 0.1]), arm.moved([0.0, 0.0, 0.2])
    with pytest.raises(InvalidArgument, match="on a straight line"):
        arm.plan_segments(Arc(up, more))
    with pytest.raises(InvalidArgument, match="three different places"):
        arm.plan_segments(Arc(up, up))


@pytest.mark.parametrize("part", [0.0, 0.3, 0.8, 0.999, 1.0])
@pytest.mark.parametrize("kind", ["corner", "joints"])
def test_what_is_left_of_a_motion_is_on_its_path(kind: str, part: float) -> None:
    arm = Arm("cr3a")
    if kind == "corner":
        poses = [arm.moved([0.0, 0.1, 0.0]), arm.moved([0.0, 0.1, 0.1])]
        whole = arm.plan(*poses, blend_m=0.03)
    else:
        whole = plan_fast_motion(arm.limits, arm.start, np.zeros(6), 0.7)
    time_s = part * whole.duration_s
    begin = positions_at(whole, time_s)
    assert place_on(whole, begin, time_s - 0.05, 0.2) == pytest.approx(time_s, abs=1e-3)
    rest = rest_of(whole, arm.limits, time_s)
    if kind == "corner":
        rest = rest_of_lines(whole, arm.limits, time_s, arm.kinematics, SPEED)
        assert rest.rate_bounds is not None
        poses = arm.kinematics.forward(dense(rest, 401))[:, :3, 3]
        hardest = np.diff(poses, 2, axis=0) / (rest.duration_s / 400) ** 2
        assert np.linalg.norm(hardest, axis=1).max() <= 1.05 * SPEED.acceleration
    assert rest.positions[0] == pytest.approx(begin)
    assert rest.positions[-1] == pytest.approx(whole.positions[-1])
    assert rest.velocities[0] == pytest.approx(0.0)
    assert (np.diff(rest.times_s) > 0.0).all()
    path = dense(whole, 20_000)
    away = [np.abs(path - place).max(axis=1).min() for place in dense(rest, 50)]
    assert max(away) < 2e-4
    step_s = rest.duration_s / 2000
    speeds = np.diff(dense(rest, 2001), axis=0) / step_s
    assert (np.abs(speeds) <= 1.01 * arm.limits.velocity).all()
    assert (np.abs(np.diff(speeds, axis=0)) / step_s <= 1.05 * arm.limits.acceleration).all()
