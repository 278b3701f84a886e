"""Twists and pose targets as a stream: direction, limits, singularities, through the limiter."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
from tests.features.tool_space.arms import kinematics_of

from robotd.api import FloatArray
from robotd.api.robots import JointLimits, MotionLimits
from robotd.motion import MotionState
from robotd.motion.limiter import SetpointLimiter
from robotd_tool_space.geometry.kinematics import Kinematics
from robotd_tool_space.geometry.rotations import pose_differences, rotation_matrices
from robotd_tool_space.streams.servo_status import ServoCode, ServoStatus
from robotd_tool_space.streams.tool_twist_limits import FactorRamp, ToolTwistLimits
from robotd_tool_space.streams.twist import Command, PoseCommand, ToolTwist, TwistStage

PERIOD_S = 0.002
READY = np.array([0.3, -0.6, 1.6, -0.3, 1.2, 0.0])
ARM = kinematics_of("cr3a")
OUT = ARM.forward(READY)[:3, 3] * [1.0, 1.0, 0.0]
OUT = OUT / np.linalg.norm(OUT)
ZERO = np.zeros(3)


@dataclass(frozen=True)
class Run:
    """References, (t, 3, n), setpoints of the limiter that follows them, poses, status."""

    references: FloatArray
    setpoints: FloatArray
    poses: FloatArray
    path: FloatArray
    status: Sequence[ServoStatus]

    @property
    def codes(self) -> set[ServoCode]:
        return {status.code for status in self.status}


def twist(linear: FloatArray, angular: FloatArray = ZERO, *, in_tool: bool = False) -> ToolTwist:
    return ToolTwist(np.concatenate([linear, angular]), in_tool)


def limits_of(arm: Kinematics) -> JointLimits:
    count = len(arm.lower)
    return JointLimits(
        arm.chain.names, arm.lower, arm.upper, np.full(count, 2.8), np.full(count, 12.5)
    )


def follow(
    start: FloatArray,
    commands: dict[float, Command],
    seconds: float,
    arm: Kinematics = ARM,
    limits: JointLimits | None = None,
    watch: Callable[[TwistStage], None] = lambda _: None,
) -> Run:
    limits = limits or limits_of(arm)
    rest = np.zeros_like(start)
    stage, limiter = TwistStage(lambda: arm, MotionLimits()), SetpointLimiter(limits, PERIOD_S)
    stage.begin(np.array([start, rest, rest]), limits, PERIOD_S)
    limiter.reset(MotionState(start, rest, rest))
    due = {round(time / PERIOD_S): command for time, command in commands.items()}
    references, setpoints, path, status = [], [], [], []
    for period in range(round(seconds / PERIOD_S)):
        if period in due:
            stage.take(due[period])
        reference = stage.advance()
        setpoint = limiter.track(reference, reference[0].tolist(), [False] * len(start))
        references.append(reference)
        setpoints.append(setpoint.copy())
        path.append(stage.pose)
        status.append(stage.status)
        watch(stage)
    poses = arm.forward(np.array(setpoints)[:, 0])
    return Run(np.array(references), np.array(setpoints), poses, np.array(path), status)


def assert_within_limits(run: Run, limits: JointLimits) -> None:
    assert (np.abs(run.references[:, 1]) <= 0.9 * limits.velocity).all()
    assert (np.abs(run.references[:, 2]) <= 0.9 * limits.acceleration).all()
    assert (run.setpoints[:, 0] >= limits.lower).all()
    assert (run.setpoints[:, 0] <= limits.upper).all()


def lateral_m(run: Run, direction: FloatArray) -> float:
    """Largest distance from the line through the start."""
    displacement = run.poses[:, :3, 3] - run.poses[0, :3, 3]
    return float(
        np.linalg.norm(displacement - np.outer(displacement @ direction, direction), axis=1).max()
    )


def test_the_tool_moves_as_commanded_and_comes_to_rest() -> None:
    up = np.array([0.0, 0.0, 0.1])
    run = follow(READY, {0.0: twist(up), 1.0: twist(ZERO)}, 1.6)
    displacement = pose_differences(run.poses[0], run.poses[-1])
    assert displacement[2] == pytest.approx(0.1, abs=0.01)  # the two ramps differ
    assert np.abs(displacement[[0, 1, 3, 4, 5]]).max() < 2e-5
    assert not run.setpoints[-1, 1].any()
    assert run.codes == {ServoCode.NO_WARNING}
    assert lateral_m(run, np.array([0.0, 0.0, 1.0])) < 1e-5


def test_a_twist_in_the_tool_frame_keeps_to_its_axis() -> None:
    run = follow(READY, {0.0: twist(np.array([0.0, 0.0, 0.1]), in_tool=True)}, 0.8)
    assert lateral_m(run, run.poses[0, :3, 2]) < 1e-5


@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["stretched", "above the shoulder"])
def test_singularities_are_approached_and_left_on_the_line(sign: float) -> None:
    away = 0.15 * sign * OUT
    run = follow(READY, {0.0: twist(away), 3.0: twist(-away), 4.4: twist(ZERO)}, 5.0)
    assert_within_limits(run, limits_of(ARM))
    assert lateral_m(run, OUT) < 2e-5
    assert np.linalg.norm((run.poses - run.path)[:, :3, 3], axis=1).max() < 2e-5
    assert ServoCode.DECELERATE_FOR_APPROACHING_SINGULARITY in run.codes
    assert run.status[1499].code is ServoCode.HALT_FOR_SINGULARITY
    assert np.abs(run.setpoints[1499, 1]).max() < 0.01
    back = (run.poses[-1, :3, 3] - run.poses[1499, :3, 3]) @ OUT * sign
    assert back < -0.03
    assert not run.setpoints[-1, 1].any()


@pytest.mark.parametrize("end", ["lower", "upper"])
@pytest.mark.parametrize("joint", [0, 5])
def test_a_joint_that_stands_at_its_limit_holds_up_nothing(end: str, joint: int) -> None:
    """Straight up: rounding leaves a velocity of 1e-16 rad/s for these two."""
    bound = getattr(limits_of(ARM), end).copy()
    bound[joint] = READY[joint]
    limits = replace(limits_of(ARM), **{end: bound})
    run = follow(READY, {0.0: twist(np.array([0.0, 0.0, 0.1]))}, 1.0, limits=limits)
    assert run.path[-1][2, 3] - run.path[0][2, 3] > 0.08
    assert run.codes == {ServoCode.NO_WARNING}


def test_a_turn_through_the_wrist_keeps_the_limits_and_the_place() -> None:
    start = READY.copy()
    start[4] = 0.9
    turn = np.array([0.0, 0.8, 0.0])
    run = follow(start, {0.0: twist(ZERO, turn), 2.0: twist(ZERO, -turn)}, 3.5)
    assert_within_limits(run, limits_of(ARM))
    assert np.ptp(run.poses[:, :3, 3], axis=0).max() < 2e-5


def test_a_joystick_is_followed_within_all_limits() -> None:
    random = np.random.default_rng(0)
    commands: dict[float, Command] = {
        0.25 * index: twist(
            random.uniform(-0.2, 0.2, 3), random.uniform(-0.6, 0.6, 3), in_tool=index % 3 == 0
        )
        for index in range(12)
    }
    run = follow(READY, commands, 3.0)
    assert_within_limits(run, limits_of(ARM))
    assert np.linalg.norm((run.poses - run.path)[:, :3, 3], axis=1).max() < 2e-5


def test_joints_brake_before_their_position_limits() -> None:
    limits = limits_of(ARM)
    limits = replace(limits, upper=np.where(np.arange(6) == 0, 0.5, limits.upper))
    run = follow(READY, {0.0: twist(np.cross([0.0, 0.0, 1.0], OUT) * 0.4)}, 2.0, limits=limits)
    assert_within_limits(run, limits)
    assert run.status[-1].code is ServoCode.JOINT_BOUND
    assert run.status[-1].text == "joint1 is at its position limit"
    assert run.setpoints[-1, 0, 0] == pytest.approx(0.5, abs=3e-3)


def test_a_pose_is_reached_on_a_straight_line() -> None:
    target = ARM.forward(READY)
    target[:3, 3] += [0.05, -0.1, -0.1]
    target[:3, :3] = rotation_matrices(np.array([0.2, -0.1, 0.1])) @ target[:3, :3]
    run = follow(READY, {0.0: PoseCommand(target)}, 4.0)
    assert np.abs(pose_differences(run.poses[-1], target)).max() < 2e-5
    displacement = np.array([0.05, -0.1, -0.1])
    assert lateral_m(run, displacement / np.linalg.norm(displacement)) < 2e-5
    assert (run.poses[:, :3, 3] - run.poses[0, :3, 3]) @ displacement / (
        displacement @ displacement
    ) == pytest.approx(0.5, abs=0.501)


@pytest.mark.parametrize("name", ["seven_axis", "scara", "gantry"])
def test_other_structures_move_straight_too(name: str) -> None:
    arm = kinematics_of(name)
    lower, upper = np.clip(arm.lower, -3.0, 3.0), np.clip(arm.upper, -3.0, 3.0)
    start = lower + np.linspace(0.6, 0.7, len(lower)) * (upper - lower)
    displacement = arm.jacobian(start) @ np.linspace(1.0, 0.5, len(start))
    command = np.concatenate([0.05 * displacement[:3] / np.linalg.norm(displacement[:3]), ZERO])
    run = follow(start, {0.0: ToolTwist(command)}, 0.5, arm)
    assert_within_limits(run, limits_of(arm))
    moved = np.linalg.norm(run.poses[-1, :3, 3] - run.poses[0, :3, 3])
    assert moved > 1e-3
    assert lateral_m(run, command[:3] / 0.05) < 2e-5


def test_a_moving_start_slows_down_to_rest() -> None:
    limits = limits_of(ARM)
    stage = TwistStage(lambda: ARM, MotionLimits())
    stage.begin(np.array([READY, np.full(6, 0.2), np.zeros(6)]), limits, PERIOD_S)
    velocity = [stage.advance()[1] for _ in range(500)]
    assert velocity[0] == pytest.approx(np.full(6, 0.2), abs=0.01)
    assert not velocity[-1].any()


@pytest.mark.parametrize(
    ("direction", "begin_s", "stop_s", "distance_m"),
    [(1.0, 0.7, 0.45, 0.1), (1.0, 0.8, 0.45, 0.068), (-1.0, 0.4, 0.4, 0.016)],
    ids=["before", "at", "above the shoulder"],
)
def test_a_stop_near_a_singularity_takes_as_long_as_the_joints_need(
    direction: float, begin_s: float, stop_s: float, distance_m: float
) -> None:
    away = twist(0.5 * direction * OUT)
    run = follow(READY, {0.0: away, begin_s: twist(ZERO)}, begin_s + 1.0)
    assert_within_limits(run, limits_of(ARM))
    begin = round(begin_s / PERIOD_S)
    moving = np.abs(run.references[begin:, 1]).max(axis=1) > 1e-3
    assert moving[0]
    assert not moving[round(stop_s / PERIOD_S) :].any()
    assert np.linalg.norm(run.poses[-1, :3, 3] - run.poses[begin, :3, 3]) < distance_m


def test_stops_at_any_time_keep_the_limits_and_the_line() -> None:
    for begin_s in np.arange(0.1, 1.4, 0.1):
        for direction in (OUT, -OUT):
            away = twist(0.5 * direction)
            run = follow(READY, {0.0: away, float(begin_s): twist(ZERO)}, float(begin_s) + 0.8)
            assert_within_limits(run, limits_of(ARM))
            assert not run.references[-1, 1].any()
            reached = ARM.forward(run.references[:, 0])[:, :3, 3]
            displacement = reached - reached[0]
            assert (
                np.linalg.norm(displacement - np.outer(displacement @ OUT, OUT), axis=1).max()
                < 1e-5
            )


def test_twists_beyond_the_speed_of_the_tool_keep_their_direction() -> None:
    limits = ToolTwistLimits(linear_m_s=0.2)
    assert limits.slowed(np.array([0.3, 0.4, 0.0, 0.0, 0.0, 1.0])) == pytest.approx(
        [0.12, 0.16, 0.0, 0.0, 0.0, 0.4]
    )


def test_the_factor_keeps_its_rate_and_meets_a_moving_limit() -> None:
    ramp = FactorRamp(PERIOD_S)
    limit, factors = 1.0, []
    for period in range(500):
        limit = max(0.2, limit - 0.002) if period > 50 else 1.0
        factors.append(ramp.advance(limit, -4.0, 4.0, 100.0))
    rates = np.diff(factors) / PERIOD_S
    assert rates.min() > -4.01
    assert np.abs(np.diff(rates)).max() / PERIOD_S < 101.0
    assert factors[-1] == pytest.approx(0.2, abs=1e-9)


@pytest.mark.parametrize(
    ("factor", "rate", "before", "limit", "highest"),
    [
        (
            0.46654680220542505,
            3.7045741168690967,
            0.49075990987125884,
            0.49475990987125884,
            6.279027730611018,
        ),
        (
            0.5020958149604375,
            1.406174678591849,
            0.59877936446944,
            0.59477936446944,
            6.174174268558358,
        ),
        (
            0.42992443410275066,
            -3.9383365016417256,
            0.3986148641561117,
            0.3946148641561117,
            11.8468068338322,
        ),
    ],
)
def test_a_factor_finds_its_way_where_it_just_can_brake(
    factor: float, rate: float, before: float, limit: float, highest: float
) -> None:
    """Ruckig finds no plan for these, which it got from itself."""
    ramp = FactorRamp(PERIOD_S)
    ramp.set(before)
    ramp.factor, ramp.rate = factor, rate
    after = ramp.advance(limit, -20.0, highest, 60.0)
    assert after == pytest.approx(factor + 0.5 * PERIOD_S * (rate + ramp.rate), abs=1e-5)
    assert abs(ramp.rate - rate) / PERIOD_S < 61.0


def test_a_start_takes_the_tool_that_is_chosen_then() -> None:
    offset = np.eye(4)
    offset[2, 3] = 0.1
    chosen = [ARM, ARM.with_tool(offset)]
    stage = TwistStage(lambda: chosen.pop(0), MotionLimits())
    for arm in tuple(chosen):
        stage.begin(np.array([READY, np.zeros(6), np.zeros(6)]), limits_of(ARM), PERIOD_S)
        assert stage.pose == pytest.approx(arm.forward(np.array(READY)))
