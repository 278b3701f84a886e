"""Segments that are appended to a motion under way, judged by the kinematics of the URDF reader."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from tests.features.tool_space.test_lines import PERIOD_S, Arm, accelerations, poses_of
from tests.features.tool_space.test_sequences import random_segments

from robotd import Robot, open_robot
from robotd.api import NotReady, read_urdf
from robotd.api.features import ProcessImage
from robotd.api.robots import Outcome
from robotd.clock.simulated import SteppedClock
from robotd_tool_space import Line, Unreachable, Wait, pose_differences
from robotd_tool_space.paths.tool_curves import ToolSpeed
from robotd_tool_space.robot_tool import RobotTool
from robotd_tool_space.sequences.motion_join import join
from robotd_tool_space.tool_groups import ToolGroups

BENT = np.array([0.0, 0.3, 1.4, -0.2, 1.2, 0.0])
SPEED = ToolSpeed(0.25, 1.0, 1.0)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(6))
def test_a_joined_motion_keeps_all_limits_and_has_no_step(seed: int) -> None:
    arm, random = Arm("cr3a"), np.random.default_rng(seed)
    for _ in range(20):
        segments, _ = random_segments(arm, random, 4)
        try:
            running = arm.plan_segments(*segments[:3], speed=SPEED)
            longer = arm.plan_segments(*segments, speed=SPEED)
            break
        except Unreachable:
            continue
    found = 0
    for after_s in np.arange(0.03, running.duration_s, 0.4):
        joined = join(running, longer, float(after_s), arm.limits, arm.kinematics, SPEED)
        if joined is None:
            continue
        found += 1
        motion, same_s = joined
        assert same_s >= after_s
        _, rows, poses = poses_of(arm, motion)
        linear, angular = accelerations(poses)
        assert linear.max() < 1.02 * SPEED.acceleration
        assert angular.max() < 1.02 * SPEED.angular_acceleration
        spline = CubicHermiteSpline(motion.times_s, motion.positions, motion.velocities)
        before = CubicHermiteSpline(running.times_s, running.positions, running.velocities)
        until_s = np.linspace(0.0, same_s, 500)
        assert spline(until_s) == pytest.approx(before(until_s), abs=1e-9)
        dense_s = np.linspace(0.0, motion.duration_s, 5000)
        assert (np.abs(spline(dense_s, 1)).max(axis=0) <= 1.0001 * arm.limits.velocity).all()
        assert (np.abs(spline(dense_s, 2)).max(axis=0) <= 1.001 * arm.limits.acceleration).all()
        # No jump of the acceleration where they change.
        sides = spline(np.array([same_s - 1e-4, same_s + 1e-4]), 2)
        assert np.abs(np.diff(sides, axis=0)).max() < 0.1 * arm.limits.acceleration.max()
        steps = pose_differences(poses[:-2], poses[1:-1]) / PERIOD_S
        assert np.linalg.norm(steps[:, :3], axis=1).max() < 1.02 * SPEED.velocity
        assert rows[-1] == pytest.approx(longer.positions[-1], abs=1e-6)
        assert len(motion.ends_s) == 4
        assert list(motion.ends_s) == sorted(motion.ends_s)
    assert found


def test_too_late_is_no_join() -> None:
    arm = Arm("cr3a")
    first = Line(arm.moved([0.0, 0.1, 0.0]), blend_m=0.01)
    running = arm.plan_segments(first, speed=SPEED)
    longer = arm.plan_segments(first, Line(arm.pose), speed=SPEED)
    late_s = running.duration_s - 0.1
    assert join(running, longer, late_s, arm.limits, arm.kinematics, SPEED) is None


@pytest.fixture
def robot() -> Iterator[Robot]:
    with open_robot("cr3a", "sim", clock=SteppedClock()) as robot:
        tool = robot.feature(ToolGroups).only
        tool.execute(tool.plan_joints(BENT))
        yield robot


@pytest.fixture
def tool(robot: Robot) -> RobotTool:
    return robot.feature(ToolGroups).only


def test_what_is_appended_in_time_joins_without_a_stop(robot: Robot, tool: RobotTool) -> None:
    period_s = 1.0 / robot.descriptor.cycle.rate_hz
    corner, end = tool.pose_relative(y=0.15), tool.pose_relative(y=0.15, z=-0.1)
    poses, joined = [], []
    urdf = read_urdf(robot.descriptor.urdf)
    run = tool.sequence(tool.plan_parts([Line(corner, blend_m=0.02)]), tool.arrive())

    def look(image: ProcessImage) -> None:
        names = zip(tool.group.joint_names, image.position_command[:6].tolist(), strict=True)
        poses.append(urdf.pose(tool.kinematics.chain.link, dict(names)))

    def tick() -> None:
        if not joined and run.progress().part > 0.15:
            joined.append(run.append([Line(end), Wait(time_s=0.2), Line(corner)]))

    robot.control_loop.every(robot.descriptor.cycle.rate_hz, "look", look)
    outcome, message = run.run(tick)
    assert (outcome, joined) == (Outcome.SUCCEEDED, [True]), message
    assert run.progress()[:2] == (4, 4)
    assert tool.pose == pytest.approx(corner, abs=1e-6)
    linear, _ = accelerations(np.array(poses))
    assert linear.max() * (PERIOD_S / period_s) ** 2 < 1.05 * tool.speed.acceleration
    near = [np.linalg.norm(pose[:3, 3] - corner[:3, 3]) for pose in poses[: len(poses) // 2]]
    assert 0.001 < min(near) < 0.02, "the corner is rounded"
    with pytest.raises(NotReady, match="the sequence has ended"):
        run.append([Line(end)])


def test_what_is_appended_too_late_begins_from_rest(robot: Robot, tool: RobotTool) -> None:
    start, there = tool.pose, tool.pose_relative(y=0.05)
    joined = []
    run = tool.sequence(tool.plan_parts([Line(there, blend_m=0.02)]), tool.arrive())

    def tick() -> None:
        if not joined and run.progress().part > 0.9:
            joined.append(run.append([Line(start)]))

    assert run.run(tick)[0] is Outcome.SUCCEEDED
    assert joined == [False]
    assert tool.pose == pytest.approx(start, abs=1e-6)


def test_what_cannot_be_appended_leaves_the_motion_as_it_is(robot: Robot, tool: RobotTool) -> None:
    there, far = tool.pose_relative(y=0.1), tool.pose_relative(z=0.6)
    errors = []
    run = tool.sequence(tool.plan_parts([Line(there)]), tool.arrive())

    def tick() -> None:
        if not errors and run.progress().part > 0.2:
            with pytest.raises(Unreachable) as error:
                run.append([Line(far)])
            errors.append(str(error.value))

    assert run.run(tick)[0] is Outcome.SUCCEEDED
    assert errors[0].startswith("segment 2, line: at ")
    assert tool.pose == pytest.approx(there, abs=1e-6)
