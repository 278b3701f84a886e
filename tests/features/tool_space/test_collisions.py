"""Collisions: distances, goals that are rejected, streams and moves that stop in time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from structlog.testing import capture_logs
from tests.features.tool_space.arms import go

from robotd import Robot, open_robot
from robotd.api import (
    DescriptorError,
    FloatArray,
    Operation,
    Profile,
    load_robot_descriptor,
    read_urdf,
)
from robotd.api.robots import MotionLimits, TrajectoryRequest, axis_limits, joint_limits
from robotd.clock.simulated import SteppedClock
from robotd.control.completion import Outcome
from robotd.device.axes import Jog, Move
from robotd.device.process_image import ProcessImage
from robotd.motion.rejection import TrajectoryRejected
from robotd_tool_space.capsules import Capsules, enclosing_capsule
from robotd_tool_space.collisions import (
    Collisions,
    box_distances,
    plane_distances,
    segment_distances,
)
from robotd_tool_space.kinematics import Kinematics
from robotd_tool_space.robot_tool import RobotTool
from robotd_tool_space.rotations import pose_of
from robotd_tool_space.servo_status import ServoCode
from robotd_tool_space.settings import ToolSpaceKeys
from robotd_tool_space.twist import Command, PoseCommand, TwistCommand, TwistStage

BENT = np.array([0.0, 0.3, 1.4, -0.2, 1.2, 0.0])
FOLDED = np.array([0.0, 0.0, 2.8, 0.0, 0.0, 0.0])
MARGIN_M = 0.01
PARTS = np.linspace(0.0, 1.0, 201)

numbers = st.floats(-1.0, 1.0).map(lambda each: round(each, 3))
segments = st.lists(numbers, min_size=6, max_size=6).map(lambda each: np.reshape(each, (2, 3)))


def points_of(segment: FloatArray) -> FloatArray:
    points: FloatArray = segment[0] + PARTS[:, None] * (segment[1] - segment[0])
    return points


@given(segments, segments)
def test_segments_are_as_far_apart_as_their_nearest_points(
    first: FloatArray, second: FloatArray
) -> None:
    sampled = np.linalg.norm(points_of(first)[:, None] - points_of(second), axis=-1).min()
    distance = float(segment_distances(first, second))
    assert distance == pytest.approx(float(segment_distances(second, first)), abs=1e-6)
    assert sampled - 0.02 < distance < sampled + 1e-6


@given(segments, st.lists(st.floats(0.05, 1.0), min_size=3, max_size=3))
def test_a_box_is_as_far_away_as_its_nearest_point(segment: FloatArray, size: list[float]) -> None:
    pose, halves = pose_of([0.3, -0.2, 0.1], [0.4, -0.3, 1.0]), 0.5 * np.array(size)
    beyond = np.abs((points_of(segment) - pose[:3, 3]) @ pose[:3, :3]) - halves
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    sampled = np.where(outside > 0.0, outside, beyond.max(axis=1)).min()
    distance = float(box_distances(segment[None], pose[None], halves[None])[0, 0])
    assert distance == pytest.approx(sampled, abs=0.01)


def test_a_plane_is_as_far_away_as_the_nearer_end() -> None:
    segment = np.array([[[0.0, 0.0, 0.3], [1.0, 0.0, -0.1]]])
    distance = plane_distances(segment, np.array([[0.0, 0.0, 1.0]]), np.array([0.05]))
    assert distance[0, 0] == pytest.approx(-0.15)


def test_a_capsule_holds_all_points_of_a_mesh() -> None:
    points = np.random.default_rng(1).normal(size=(200, 3)) * [0.3, 0.05, 0.08]
    for each in (points, points * 0.1 + 1.0, points[:4]):
        ends, radius = enclosing_capsule(each)
        off = segment_distances(ends[None], np.repeat(each[:, None], 2, axis=1))
        assert off.max() <= radius + 1e-9
        assert radius < np.ptp(each)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("arm") / "robot.yaml"
    path.write_text(
        "extends: cr3a\nname: arm\ntool_space:\n  collisions:\n"
        "    planes:\n      wall: {normal: [0, -2, 0], distance_m: -0.35}\n"
        "    boxes:\n      machine: {xyz_m: [-0.75, 0, 0.4], size_m: [0.4, 1, 0.8]}\n",
        encoding="utf-8",
    )
    return path


class Arm:
    """A robot on a stepped clock, and the least distance of each period."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.tool: RobotTool = robot.attribute("tool")
        robot.attribute("collision_guard")
        settings = robot.descriptor.settings(ToolSpaceKeys).tool_space.collisions
        assert settings is not None
        self.collisions = Collisions.of(robot.descriptor, self.tool.at_link, settings)
        self.follower = self.tool.group.follower

    @property
    def position(self) -> FloatArray:
        return self.robot.image.position_command[:6].copy()

    def run(self, periods: int) -> float:
        """Return the least distance meanwhile."""
        positions = []
        for _ in range(periods):
            self.robot.step(1)
            positions.append(self.position)
        return float(self.collisions.distances(np.array(positions)).min())

    def request(self, goal: FloatArray, seconds: float = 3.0) -> TrajectoryRequest:
        return TrajectoryRequest(self.tool.group.joint_names, np.array([seconds]), np.array([goal]))


@pytest.fixture(scope="module")
def collisions(file: Path) -> Collisions:
    descriptor = load_robot_descriptor(file)
    settings = descriptor.settings(ToolSpaceKeys).tool_space.collisions
    assert settings is not None
    return Collisions.of(descriptor, Kinematics.of_descriptor(descriptor, "joints"), settings)


@pytest.fixture
def arm(file: Path) -> Iterator[Arm]:
    with open_robot(file, "sim", clock=SteppedClock()) as robot:
        arm = Arm(robot)
        go(arm.tool, BENT)
        yield arm


def test_a_goal_that_folds_the_arm_is_rejected_with_the_links(arm: Arm) -> None:
    with (
        pytest.raises(
            TrajectoryRejected,
            match=r"at 2\.\d\d s \(\d\d %\) link1 and link3 would be 9\.\d+ mm apart, "
            "the least distance is 10 mm",
        ),
        arm.follower.follow(arm.request(FOLDED)),
    ):
        pass
    assert (arm.position == BENT).all()


@pytest.mark.parametrize(
    ("goal", "what"), [([-1.6, *BENT[1:]], "wall"), ([0.0, 1.57, 0.0, 0.0, 0.0, 0.0], "machine")]
)
def test_walls_are_rejected_by_name(arm: Arm, goal: list[float], what: str) -> None:
    with (
        pytest.raises(TrajectoryRejected, match=f"and {what} would "),
        arm.follower.follow(arm.request(np.array(goal))),
    ):
        pass


def test_an_arm_in_a_box_goes_no_deeper_and_may_leave_it(collisions: Collisions) -> None:
    in_machine, deeper = (np.array([0.0, angle, 0.0, 0.0, 0.0, 0.0]) for angle in (1.2, 1.22))
    assert "machine would touch" in collisions.obstacle(in_machine, deeper)
    assert collisions.obstacle(deeper, in_machine) == ""


def test_a_line_is_rejected_with_its_place(arm: Arm) -> None:
    motion = arm.tool.plan_lines([arm.tool.pose_relative(y=0.45)])
    with pytest.raises(TrajectoryRejected, match="and wall would"):
        arm.follower.check(motion.request(arm.tool.group.joint_names))
    with (
        pytest.raises(TrajectoryRejected, match=r"\(\d\d %\) \w+ and wall would"),
        arm.tool.follow(motion),
    ):
        pass
    with arm.tool.follow(arm.tool.plan_lines([arm.tool.pose_relative(y=0.1)])) as execution:
        arm.tool.wait(execution)
    assert execution.outcome is Outcome.SUCCEEDED


def test_a_twist_stops_before_a_wall_and_leaves_it(arm: Arm) -> None:
    toward, away = np.zeros(6), np.zeros(6)
    toward[1], away[1] = 0.5, -0.3
    with arm.tool.stream(timeout_s=100.0) as stream:
        nearest = np.inf
        for _ in range(100):  # a client that goes on
            stream.send(toward.tolist())
            nearest = min(nearest, arm.run(10))
        assert stream._stage.status.code is ServoCode.HALT_FOR_COLLISION
        assert "and wall would be" in stream.slow_reason
        assert MARGIN_M - 1e-4 < nearest < MARGIN_M + 0.03
        before = arm.position
        arm.run(50)
        assert arm.position == pytest.approx(before, abs=1e-6), "it stands"
        stream.send(away.tolist())
        arm.run(200)
        assert stream._stage.status.code is ServoCode.NO_WARNING
    assert arm.collisions.distances(arm.position[None]).min() > nearest + 0.01


TOWARDS = np.array([0.0, 0.5, 0.0, 0.0, 0.0, 0.0])
CURVED = np.array([0.25, 0.4, -0.1, 0.0, 0.8, 0.5])
NEAR = PoseCommand(pose_of([-0.577, -0.121, 0.489], [-0.076, 0.37, -1.598]))  # as at ``BENT``
THERE = PoseCommand(pose_of([0.2, 0.9, 0.4], [0.0, 2.0, 0.0]))


@pytest.mark.parametrize("periods", [1, 5, 20], ids=lambda each: f"every {each}")
@pytest.mark.parametrize(
    "command",
    [
        TwistCommand(TOWARDS),
        TwistCommand(CURVED),
        TwistCommand(CURVED, in_tool=True),
        THERE,
        NEAR,
    ],
    ids=["straight", "turning", "in the tool", "pose", "near pose"],
)
def test_the_tool_stops_in_time_however_often_a_client_goes_on(
    collisions: Collisions, command: Command, periods: int
) -> None:
    descriptor = load_robot_descriptor("cr3a")
    arm, limits = Kinematics.of_descriptor(descriptor, "joints"), MotionLimits()
    limits.obstacle = collisions.obstacle
    stage, rest = TwistStage(lambda: arm, limits), np.zeros(6)
    joints = joint_limits(descriptor.joints, axis_limits(descriptor))
    stage.begin(np.array([BENT, rest, rest]), joints, 0.002)
    path, codes = [], set()
    for period in range(1200):
        if period % periods == 0:
            stage.take(command)
        path.append(stage.advance())
        codes.add(stage.status.code)
    assert ServoCode.HALT_FOR_COLLISION in codes
    assert np.abs(path[-1][1]).max() < 0.01
    nearest = collisions.distances(np.array(path)[:, 0]).min()
    assert MARGIN_M - 0.001 < nearest < MARGIN_M + 0.03


@pytest.mark.parametrize("mode", ["position", "velocity"])
def test_a_stream_of_joints_stops_before_a_collision_and_leaves(arm: Arm, mode: str) -> None:
    with arm.tool.group.stream(timeout_s=100.0) as stream:
        nearest = np.inf
        for _ in range(60):
            if mode == "position":
                stream.send(FOLDED.tolist())
            else:
                stream.send_velocity([0.0, 0.0, 2.0, 0.0, 0.0, 0.0])
            nearest = min(nearest, arm.run(10))
        assert MARGIN_M - 1e-4 < nearest < MARGIN_M + 0.02
        stream.send(BENT.tolist())
        arm.run(800)
    assert arm.position == pytest.approx(BENT, abs=1e-6)


def test_moves_and_jogs_of_single_axes_stop_before_a_collision(arm: Arm) -> None:
    axes = arm.robot.axes
    axes.move([Move(0, -1.6, Profile(1.0, 5.0, 5.0))])
    nearest = arm.run(1500)
    assert MARGIN_M < nearest < MARGIN_M + 0.03
    assert arm.robot.image.operation[0] == Operation.IDLE
    axes.move([Move(0, 0.0, Profile(1.0, 5.0, 5.0))])
    arm.run(1500)
    assert arm.position == pytest.approx(BENT)
    axes.set_command_mode(0, 1)
    axes.jog([Jog(0, Profile(-1.0, 5.0, 5.0))])
    assert MARGIN_M < arm.run(1500) < MARGIN_M + 0.03
    assert arm.robot.image.operation[0] == Operation.IDLE


def test_a_move_stops_while_the_position_of_another_joint_is_not_known(arm: Arm) -> None:
    driver = arm.robot.control_loop._driver
    read = driver.read

    def read_partly(image: ProcessImage) -> None:
        read(image)
        image.position[3] = np.nan  # of a drive that was not there at the start

    driver.read = read_partly  # type: ignore[method-assign]
    arm.robot.step(1)
    with capture_logs() as lines:
        arm.robot.axes.move([Move(0, 0.5, Profile(0.5, 5.0, 5.0))])
        arm.robot.step(200)
    assert arm.robot.image.operation[0] == Operation.IDLE
    assert arm.position[0] == pytest.approx(BENT[0], abs=0.01)
    assert [line["reason"] for line in lines] == ["the position of joint4 is not known"]


def test_a_urdf_without_shapes_is_an_error(file: Path) -> None:
    path = file.with_name("bare.yaml")
    path.write_text("extends: scara\nname: bare\ntool_space: {collisions: {}}\n", encoding="utf-8")
    with (
        open_robot(path, "sim", clock=SteppedClock()) as robot,
        pytest.raises(DescriptorError, match="no link has a shape"),
    ):
        robot.attribute("collision_guard")


def test_links_of_other_groups_are_left_out() -> None:
    path = Path(__file__).parents[3] / "robots/dual_cr3a/dual_cr3a.urdf"
    urdf = read_urdf(path)
    moved = [joint.name for joint in urdf.joints if joint.type == "revolute"]
    left, right = moved[:6], moved[6:12]
    from robotd_tool_space import Chain

    chain = Chain.of_urdf(urdf, left, urdf.joint[left[-1]].child, right)
    links = Capsules.of_urdf(urdf, path, chain, right).links
    assert not {urdf.joint[name].child for name in right} & {*links}
    assert {urdf.joint[name].child for name in left} <= {*links}
