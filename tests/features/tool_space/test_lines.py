"""Lines of the tool as trajectories of the joints."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from robotd.api import FloatArray, InvalidArgument, load_robot_descriptor, read_urdf
from robotd.api.robots import axis_limits, joint_limits
from robotd_tool_space import Kinematics, Unreachable, UnreachableCause, pose_differences, pose_of
from robotd_tool_space.paths.segments import Line, MotionSegment
from robotd_tool_space.paths.tool_curves import ToolSpeed
from robotd_tool_space.paths.tool_motion import ToolMotion, plan_joint_motion
from robotd_tool_space.sequences.sequence_plan import (
    LINE_TOLERANCE_M,
    LINE_TOLERANCE_RAD,
    plan_sequence,
)

PERIOD_S = 0.002
STARTS = {
    "cr3a": [0.0, 0.3, 1.4, -0.2, 1.2, 0.0],
    "scara": [0.4, 0.9, 0.05, 0.3],
    "gantry": [0.5, 0.0, -0.3],
    "palletiser": [0.3, 0.2, 0.6, 0.1],
}
WAYS = {
    "cr3a": ([0.0, 0.2, -0.1], [0.1, 0.0, 0.5]),
    "scara": ([-0.08, 0.1, 0.03], [0.0, 0.0, 1.5]),
    "gantry": ([0.8, -0.3, 0.2], [0.0, 0.0, 0.0]),
    "palletiser": ([-0.2, 0.5, 0.3], [0.0, 0.0, 1.0]),
}
SPEED = ToolSpeed(0.5, 1.5, 2.0)


class Arm:
    def __init__(self, name: str) -> None:
        self.descriptor = load_robot_descriptor(name)
        self.kinematics = Kinematics.of_descriptor(self.descriptor, "joints")
        self.limits = joint_limits(self.descriptor.joints, axis_limits(self.descriptor))
        self.start = np.array(STARTS[name])
        self.pose = self.kinematics.forward(self.start)

    def moved(self, xyz: list[float], rpy: list[float] | None = None) -> FloatArray:
        target = pose_of(rpy=rpy or [0.0] * 3) @ self.pose
        target[:3, 3] = self.pose[:3, 3] + xyz
        return target

    def plan(self, *poses: FloatArray, speed: ToolSpeed = SPEED, blend_m: float = 0) -> ToolMotion:
        return self.plan_segments(*(Line(pose, blend_m=blend_m) for pose in poses), speed=speed)

    def plan_segments(
        self, *segments: MotionSegment, speed: ToolSpeed = SPEED, constant_speed: bool = False
    ) -> ToolMotion:
        return plan_sequence(
            self.kinematics,
            self.limits,
            self.start,
            segments,
            speed,
            constant_speed=constant_speed,
        )


def poses_of(arm: Arm, motion: ToolMotion) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Times, joint positions and poses of each period, by other code than that which plans."""
    assert arm.descriptor.urdf is not None
    urdf, link = read_urdf(arm.descriptor.urdf), arm.kinematics.chain.link
    spline = CubicHermiteSpline(motion.times_s, motion.positions, motion.velocities)
    times_s = np.arange(0.0, motion.duration_s + PERIOD_S, PERIOD_S).clip(max=motion.duration_s)
    names = arm.kinematics.chain.names
    rows = spline(times_s)
    poses = [urdf.pose(link, dict(zip(names, row.tolist(), strict=True))) for row in rows]
    return times_s, rows, np.array(poses)


@pytest.mark.parametrize("name", STARTS)
def test_a_line_is_straight_at_every_period(name: str) -> None:
    arm = Arm(name)
    target = arm.moved(*WAYS[name])
    motion = arm.plan(target)
    _, rows, poses = poses_of(arm, motion)
    assert poses[-1] == pytest.approx(target, abs=1e-6)
    assert rows[0] == pytest.approx(arm.start)
    displacement = target[:3, 3] - arm.pose[:3, 3]
    along = displacement / np.linalg.norm(displacement)
    off = poses[:, :3, 3] - arm.pose[:3, 3]
    lateral = np.linalg.norm(off - np.outer(off @ along, along), axis=1)
    assert lateral.max() < LINE_TOLERANCE_M
    # The rotation is about one axis, in step with the translation.
    turn = pose_differences(arm.pose, target)[3:]
    part = np.clip(off @ along / np.linalg.norm(displacement), 0.0, 1.0)
    turned = pose_differences(np.tile(arm.pose, (len(poses), 1, 1)), poses)[:, 3:]
    assert np.linalg.norm(turned - part[:, None] * turn, axis=1).max() < LINE_TOLERANCE_RAD


@pytest.mark.parametrize("name", STARTS)
def test_limits_of_tool_and_joints_are_kept(name: str) -> None:
    arm = Arm(name)
    motion = arm.plan(arm.moved(*WAYS[name]), speed=ToolSpeed(5.0, 20.0, 50.0))
    spline = CubicHermiteSpline(motion.times_s, motion.positions, motion.velocities)
    times_s = np.linspace(0.0, motion.duration_s, 5000)
    assert (np.abs(spline(times_s, 1)).max(axis=0) <= arm.limits.velocity * 1.0001).all()
    assert (np.abs(spline(times_s, 2)).max(axis=0) <= arm.limits.acceleration * 1.001).all()
    slow = ToolSpeed(0.1, 0.5, 1.0)
    times_s, _, poses = poses_of(arm, arm.plan(arm.moved(*WAYS[name]), speed=slow))
    steps = pose_differences(poses[:-2], poses[1:-1]) / PERIOD_S
    assert np.linalg.norm(steps[:, :3], axis=1).max() < 0.1 * 1.01
    assert np.linalg.norm(steps[:, 3:], axis=1).max() < 0.5 * 1.01


def test_corners_stop_or_are_rounded() -> None:
    arm = Arm("cr3a")
    corners = [arm.moved(xyz) for xyz in ([0, 0.1, 0], [0, 0.1, -0.1], [0, 0, -0.1])]
    sharp, round_ = arm.plan(*corners), arm.plan(*corners, blend_m=0.02)
    assert round_.duration_s < 0.9 * sharp.duration_s
    place = corners[0][:3, 3]
    nearest = [
        np.linalg.norm(poses_of(arm, path)[2][:, :3, 3] - place, axis=1).min()
        for path in (sharp, round_)
    ]
    assert nearest[0] < 1e-4
    assert 0.002 < nearest[1] < 0.02
    assert round_.deviation_m < LINE_TOLERANCE_M


def accelerations(poses: FloatArray) -> tuple[FloatArray, FloatArray]:
    """m/s² and rad/s² of the tool, from poses of each period."""
    steps = np.diff(pose_differences(poses[:-2], poses[1:-1]) / PERIOD_S, axis=0) / PERIOD_S
    return np.linalg.norm(steps[:, :3], axis=1), np.linalg.norm(steps[:, 3:], axis=1)


@pytest.mark.parametrize("blend_m", [0.002, 0.005, 0.02])
@pytest.mark.parametrize("acceleration", [0.3, 1.0])
def test_the_tool_keeps_its_acceleration_in_rounded_corners(
    blend_m: float, acceleration: float
) -> None:
    arm, speed = Arm("cr3a"), ToolSpeed(0.25, 1.0, acceleration)
    corners = [arm.moved(xyz) for xyz in ([0, 0.1, 0], [0, 0.1, -0.1], [0, 0, -0.1], [0, 0, 0])]
    motion = arm.plan(*corners, speed=speed, blend_m=blend_m)
    times_s, _, poses = poses_of(arm, motion)
    linear, _ = accelerations(poses)
    assert linear.max() < 1.02 * acceleration
    speeds = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1) / PERIOD_S
    inner = (times_s[:-1] > 0.3) & (times_s[:-1] < motion.duration_s - 0.3)
    assert speeds[inner].min() > 0.01, "it does not stop in a corner"


@pytest.mark.parametrize("seed", range(12))
def test_the_tool_keeps_its_accelerations_on_random_paths(seed: int) -> None:
    arm, random = Arm("cr3a"), np.random.default_rng(seed)
    displacements = random.normal(size=(4, 3)) * random.choice([0.0, 0.005, 0.04])
    turns = random.normal(size=(4, 3)) * random.choice([0.0, 0.02, 0.3])
    turns[0] += 0.05  # one that moves
    places = [
        arm.moved(displacement.tolist(), turn.tolist())
        for displacement, turn in zip(displacements, turns, strict=True)
    ]
    speed = ToolSpeed(0.25, 1.0, random.uniform(0.3, 3.0))
    motion = arm.plan(*places, speed=speed, blend_m=random.choice([0.0, 0.001, 0.01]))
    linear, angular = accelerations(poses_of(arm, motion)[2])
    assert linear.max() < 1.02 * speed.acceleration
    assert angular.max() < 1.02 * speed.angular_acceleration


@pytest.mark.parametrize("distance_m", [0.0, 0.004])
def test_a_corner_between_two_turns_is_as_near_as_one_between_two_ways(distance_m: float) -> None:
    arm, speed = Arm("cr3a"), ToolSpeed(0.25, 1.0, 1.0)
    turned = arm.moved([0.0, distance_m, 0.0], [0.0, 0.0, np.radians(60.0)])
    motion = arm.plan(turned, arm.pose, speed=speed, blend_m=0.001)
    off = pose_differences(poses_of(arm, motion)[2], turned)
    assert np.linalg.norm(off[:, 3:], axis=1).min() < 0.001 * 1.0 / 0.25
    assert np.linalg.norm(off[:, :3], axis=1).min() < 0.001


@pytest.mark.parametrize("step_m", [0.0002, 0.001, 0.005, 0.02])
@pytest.mark.parametrize("name", STARTS)
def test_the_tool_stops_at_each_pose_of_many_short_lines(name: str, step_m: float) -> None:
    arm, random = Arm(name), np.random.default_rng(1)
    displacements = random.normal(size=(20, 3))
    displacements *= step_m / np.linalg.norm(displacements, axis=1, keepdims=True)
    places = np.cumsum(displacements, axis=0)
    motion = arm.plan(*(arm.moved(xyz.tolist()) for xyz in places))
    assert motion.deviation_m < LINE_TOLERANCE_M
    reached = arm.kinematics.forward(motion.positions)[:, :3, 3] - arm.pose[:3, 3]
    for place in places:
        nearest = np.linalg.norm(reached - place, axis=1).argmin()
        assert reached[nearest] == pytest.approx(place, abs=1e-6)
        assert motion.velocities[nearest] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("xyz", "cause", "text"),
    [
        ([0.0, 0.0, 2.0], None, r"^at \d+ % "),
        ([0.0, 0.0, 0.6], UnreachableCause.SINGULAR, r"^at \d+ % joint3 .*singular"),
    ],
)
def test_a_line_that_cannot_be_is_rejected_with_the_place(
    xyz: list[float], cause: UnreachableCause | None, text: str
) -> None:
    arm = Arm("cr3a")
    with pytest.raises(Unreachable, match=text) as rejected:
        arm.plan(arm.moved(xyz))
    assert rejected.value.place is not None
    assert 0.0 < rejected.value.place < 1.0
    assert cause in (None, rejected.value.cause)


def test_a_joint_limit_on_the_line_is_named() -> None:
    arm = Arm("gantry")
    with pytest.raises(Unreachable, match=r"^at 50 % joint2 would have to be at .* m, its limit"):
        arm.plan(arm.moved([0.0, 1.0, 0.0]))
    with pytest.raises(Unreachable, match=r"about z of the base by .* rad, which no joint"):
        arm.plan(arm.moved([0.0, 0.1, 0.0], [0.0, 0.0, 0.3]))


def test_a_line_of_years_is_rejected_before_it_fills_the_memory() -> None:
    arm = Arm("cr3a")
    slow = ToolSpeed(1e-9, 1.0, 1.0)
    target = arm.moved([0.0, 0.0, -0.05])
    with pytest.raises(InvalidArgument, match=r"the motion takes 5\d{7} s, at most 3600 s"):
        arm.plan(target, speed=slow)


def test_lines_that_would_be_planned_for_minutes_are_rejected_at_once() -> None:
    arm = Arm("cr3a")
    there_and_back = [arm.moved([0.0, 9.0 * side, 0.0]) for side in (1.0, -1.0) * 3]
    text = "lines of 6 pieces need 24001 steps of 2 mm or 0.01 rad, at most 20000 are planned"
    with pytest.raises(InvalidArgument, match=text):
        arm.plan(*there_and_back)


def test_a_tool_that_is_there_already_stands() -> None:
    arm = Arm("cr3a")
    motion = arm.plan(arm.pose)
    assert (motion.positions == arm.start).all()
    assert (motion.velocities == 0.0).all()


def test_joints_move_together_within_their_limits() -> None:
    arm = Arm("cr3a")
    goal = arm.start + np.array([1.0, -0.5, 0.3, 0.0, 0.2, 2.0])
    fast = ToolSpeed(100.0, 100.0, 100.0)
    motion = plan_joint_motion(arm.kinematics, arm.limits, arm.start, goal, fast)
    spline = CubicHermiteSpline(motion.times_s, motion.positions, motion.velocities)
    speeds = np.abs(spline(np.linspace(0.0, motion.duration_s, 2000), 1)).max(axis=0)
    assert (speeds <= arm.limits.velocity * 1.0001).all()
    assert motion.positions[-1] == pytest.approx(goal)
    slow = plan_joint_motion(arm.kinematics, arm.limits, arm.start, goal, SPEED)
    assert slow.duration_s > motion.duration_s, "the speed of the tool counts"
