"""One motion of mixed segments, judged by the kinematics of the URDF reader."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from tests.features.tool_space.test_lines import PERIOD_S, SPEED, Arm, accelerations, poses_of

from robotd.api import FloatArray, InvalidArgument
from robotd_tool_space import Unreachable, pose_differences, pose_of
from robotd_tool_space.paths.segments import Arc, ArcAbout, JointMove, Line, MotionSegment, Spline
from robotd_tool_space.paths.tool_curves import ToolSpeed
from robotd_tool_space.paths.tool_motion import ToolMotion
from robotd_tool_space.sequences.sequence_plan import LINE_TOLERANCE_M, trace_sequence

KINDS = ("joint move", "joint move to a pose", "line", "arc", "arc about", "spline")


def random_segments(
    arm: Arm, random: np.random.Generator, count: int
) -> tuple[list[MotionSegment], list[FloatArray]]:
    """Segments of mixed kinds, and the pose that each leads to."""
    segments: list[MotionSegment] = []
    ends = []

    def pose() -> FloatArray:
        displacement, turn = 0.03 * random.normal(size=3), 0.15 * random.normal(size=3)
        return arm.moved(displacement.tolist(), turn.tolist())

    for kind in random.choice(KINDS, count):
        options: dict[str, Any] = {
            "speed": float(random.choice([0.3, 0.6, 1.0])),
            "blend_m": float(random.choice([0.0, 0.005, 0.02])),
            "blend_rad": random.choice([None, 0.05, 0.3]),
        }
        end = pose()
        match kind:
            case "joint move":
                goal = arm.start + 0.1 * random.normal(size=6)
                end = arm.kinematics.forward(goal)
                segments.append(JointMove(goal, **options))
            case "joint move to a pose":
                segments.append(JointMove(end, **options))
            case "line":
                segments.append(Line(end, **options))
            case "arc":
                segments.append(Arc(pose(), end, **options))
            case "arc about":
                centre, before = pose_of(rpy=random.normal(size=3)), ends[-1] if ends else arm.pose
                centre[:3, 3] = before[:3, 3] + 0.03 * random.normal(size=3)
                angle, turns = float(random.uniform(-1.0, 1.0)), bool(random.integers(2))
                turned = centre @ pose_of(rpy=[0.0, 0.0, angle]) @ np.linalg.inv(centre)
                end = turned @ before
                if not turns:
                    end[:3, :3] = before[:3, :3]
                segments.append(ArcAbout(centre, angle, turns=turns, **options))
            case _:
                segments.append(Spline([pose(), pose(), end], **options))
        ends.append(end)
    return segments, ends


def plan_possible(
    arm: Arm, seed: int, speed: ToolSpeed
) -> tuple[list[MotionSegment], list[FloatArray], ToolMotion]:
    """A random sequence that the arm can follow."""
    random = np.random.default_rng(seed)
    for _ in range(20):
        segments, ends = random_segments(arm, random, 5)
        try:
            return segments, ends, arm.plan_segments(*segments, speed=speed)
        except Unreachable:
            continue
    raise AssertionError("none of 20 sequences can be followed")


@pytest.mark.parametrize("seed", range(8))
def test_a_sequence_keeps_all_limits_and_its_blends(seed: int) -> None:
    arm = Arm("cr3a")
    speed = ToolSpeed(0.25, 1.0, float(np.random.default_rng(seed).uniform(0.3, 3.0)))
    segments, ends, motion = plan_possible(arm, seed, speed)
    times_s, _, poses = poses_of(arm, motion)
    linear, angular = accelerations(poses)
    assert linear.max() < 1.02 * speed.acceleration
    assert angular.max() < 1.02 * speed.angular_acceleration
    steps = pose_differences(poses[:-2], poses[1:-1]) / PERIOD_S
    assert np.linalg.norm(steps[:, :3], axis=1).max() < 1.02 * speed.velocity
    assert np.linalg.norm(steps[:, 3:], axis=1).max() < 1.02 * speed.angular_velocity
    spline = CubicHermiteSpline(motion.times_s, motion.positions, motion.velocities)
    dense_s = np.linspace(0.0, motion.duration_s, 5000)
    assert (np.abs(spline(dense_s, 1)).max(axis=0) <= 1.0001 * arm.limits.velocity).all()
    assert (np.abs(spline(dense_s, 2)).max(axis=0) <= 1.001 * arm.limits.acceleration).all()
    assert motion.deviation_m < LINE_TOLERANCE_M
    assert poses[-1] == pytest.approx(ends[-1], abs=1e-5)
    for segment, end, end_s in zip(segments[:-1], ends, motion.ends_s, strict=False):
        at = int(np.abs(times_s - end_s).argmin())
        off = pose_differences(poses[at], end)
        blend = segment.blend(speed)
        assert np.linalg.norm(off[:3]) <= blend.linear + LINE_TOLERANCE_M
        assert np.linalg.norm(off[3:]) <= blend.angular + 1e-3
        if not segment.blend_m:
            assert spline(end_s, 1) == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("first", ["line", "joint move"])
def test_what_a_check_follows_is_the_way_of_the_plan(first: str) -> None:
    arm = Arm("cr3a")
    a, b = arm.moved([0.0, 0.1, 0.0]), arm.moved([0.0, 0.1, -0.1])
    segments = [Line(a, blend_m=0.02) if first == "line" else JointMove(a, blend_m=0.02), Line(b)]
    _, planned, _ = poses_of(arm, arm.plan_segments(*segments))
    traced = trace_sequence(arm.kinematics, arm.limits, arm.start, segments, SPEED)
    for one, other in ((traced, planned), (planned, traced)):  # neither leaves the other
        away = np.abs(one[:, None] - other[None]).max(axis=2).min(axis=1)
        assert away.max() < 0.01
    assert traced[-1] == pytest.approx(planned[-1], abs=1e-6)


def test_outside_of_its_corners_the_tool_is_on_its_lines() -> None:
    arm, blend_m = Arm("cr3a"), 0.02
    a, b = arm.moved([0.0, 0.1, 0.0]), arm.moved([0.0, 0.1, -0.1])
    motion = arm.plan_segments(Line(a, blend_m=blend_m, speed=0.5), Line(b))
    places = poses_of(arm, motion)[2][:, :3, 3]
    far = np.linalg.norm(places - a[:3, 3], axis=1) > blend_m + LINE_TOLERANCE_M
    first, second = np.abs(places - a[:3, 3])[:, [0, 2]], np.abs(places - a[:3, 3])[:, :2]
    off = np.minimum(np.linalg.norm(first, axis=1), np.linalg.norm(second, axis=1))
    assert off[far].max() < LINE_TOLERANCE_M


@pytest.mark.parametrize("turns", [True, False])
def test_a_full_circle_about_a_centre(turns: bool) -> None:
    arm, radius = Arm("cr3a"), 0.04
    centre = pose_of([0.0, radius, 0.0])
    centre[:3, 3] += arm.pose[:3, 3]
    angle = np.pi if turns else 2.0 * np.pi
    motion = arm.plan_segments(ArcAbout(centre, angle, turns=turns))
    _, _, poses = poses_of(arm, motion)
    off = poses[:, :3, 3] - centre[:3, 3]
    assert np.linalg.norm(off, axis=1) == pytest.approx(radius, abs=LINE_TOLERANCE_M)
    assert off[:, 2] == pytest.approx(0.0, abs=LINE_TOLERANCE_M)
    turned = pose_differences(arm.pose, poses[-1])[3:]
    assert np.linalg.norm(turned) == pytest.approx(np.pi if turns else 0.0, abs=1e-3)


def test_a_spline_passes_its_poses_without_a_stop() -> None:
    arm = Arm("cr3a")
    displacements = ([0.0, 0.05, 0.0], [0.0, 0.08, -0.04], [0.02, 0.02, -0.06])
    through = [
        arm.moved(displacement, [0.0, 0.0, 0.2 * number])
        for number, displacement in enumerate(displacements)
    ]
    motion = arm.plan_segments(Spline(through))
    times_s, _, poses = poses_of(arm, motion)
    for pose in through:
        off = np.linalg.norm(poses[:, :3, 3] - pose[:3, 3], axis=1)
        assert off.min() < 2.0 * PERIOD_S * 0.5
        turned = pose_differences(poses[off.argmin()], pose)[3:]
        assert np.linalg.norm(turned) < 2.0 * PERIOD_S * 1.5
    speeds = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1) / PERIOD_S
    inner = (times_s[:-1] > 0.2) & (times_s[:-1] < motion.duration_s - 0.2)
    assert speeds[inner].min() > 0.05


def test_a_constant_speed_is_constant_between_its_ramps() -> None:
    arm = Arm("cr3a")
    speed = ToolSpeed(0.2, 1.0, 1.0)
    corners = [
        arm.moved(displacement) for displacement in ([0, 0.1, 0], [0, 0.1, -0.1], [0, 0, -0.1])
    ]
    segments = [Line(corner, blend_m=0.02) for corner in corners]
    motion = arm.plan_segments(*segments, speed=speed, constant_speed=True)
    times_s, _, poses = poses_of(arm, motion)
    speeds = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1) / PERIOD_S
    inner = (times_s[:-1] > 0.35) & (times_s[:-1] < motion.duration_s - 0.35)
    assert speeds[inner].max() < 1.02 * speeds[inner].min()
    assert 0.1 < speeds.max() < 0.2
    assert accelerations(poses)[0].max() < 1.02
    back = [Line(arm.moved([0, 0.1, 0]), blend_m=0.001), Line(arm.pose)]
    with pytest.raises(InvalidArgument, match=r"at \d+ % the tool cannot keep a constant speed"):
        arm.plan_segments(*back, speed=speed, constant_speed=True)


def test_a_corner_that_cannot_be_blended_is_a_stop_and_is_named() -> None:
    arm = Arm("cr3a")
    turned = arm.moved([0.0, 0.05, 0.0], [0.0, 0.0, 0.3])
    motion = arm.plan_segments(Line(turned, blend_m=0.01, blend_rad=0.0), Line(arm.pose))
    text = "segment 1, line, ends at rest: no corner to the next one is within 0.01 m and 0 rad"
    assert motion.notes == (text,)
    at = int(np.abs(motion.times_s - motion.ends_s[0]).argmin())
    assert motion.velocities[at] == pytest.approx(0.0, abs=1e-9)
    assert not arm.plan_segments(Line(turned, blend_m=0.01), Line(arm.pose)).notes


def test_errors_name_the_segment_and_the_place() -> None:
    arm = Arm("cr3a")
    up, beyond = arm.moved([0.0, 0.0, 0.05]), arm.moved([0.0, 0.0, 0.6])
    with pytest.raises(Unreachable, match=r"^segment 2, line: at \d+ % "):
        arm.plan_segments(Line(up), Line(beyond))
    with pytest.raises(InvalidArgument, match=r"^segment 1, line: blend_m is -1.0, must be"):
        arm.plan_segments(Line(up, blend_m=-1.0), Line(arm.pose))
    with pytest.raises(InvalidArgument, match=r"^segment 2, arc: the tool is on the axis"):
        arm.plan_segments(Line(up), ArcAbout(up, 1.0))
    with pytest.raises(InvalidArgument, match=r"^angle is 13 rad, must be up to 12.57"):
        arm.plan_segments(ArcAbout(arm.pose, 13.0))
    with pytest.raises(InvalidArgument, match=r"^joint2 would have to be at 9 rad"):
        arm.plan_segments(JointMove(arm.start + 8.7 * np.eye(6)[1]))
    with pytest.raises(InvalidArgument, match="pose 2 of the spline is the same as the one before"):
        arm.plan_segments(Spline([up, up]))
