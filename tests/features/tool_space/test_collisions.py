"""Collisions: distances, goals that are rejected, streams and moves that stop in time."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path

import mujoco
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
from robotd.api.models import parse_override
from robotd.api.robots import MotionLimits, TrajectoryRequest, axis_limits, joint_limits
from robotd.clock.simulated import SteppedClock
from robotd.control.loop.setpoint_source import Outcome
from robotd.device.axes import Jog, Move
from robotd.device.process_image import ProcessImage
from robotd.motion.rejection import TrajectoryRejected
from robotd.robot import build_robot
from robotd_tool_space import ToolGroups, Unreachable
from robotd_tool_space.collision.bodies import Bodies, enclosing_body
from robotd_tool_space.collision.collisions import Collisions
from robotd_tool_space.collision.distances import (
    Shapes,
    box_distances,
    plane_distances,
    segment_ways,
    widest_gaps,
)
from robotd_tool_space.collision.unchecked_pairs import check_collisions
from robotd_tool_space.geometry.kinematics import Kinematics
from robotd_tool_space.geometry.rotations import pose_of
from robotd_tool_space.settings import CollisionSettings, ToolSpaceKeys
from robotd_tool_space.streams.servo_status import ServoCode
from robotd_tool_space.streams.twist import Command, PoseCommand, ToolTwist, TwistStage

BENT = np.array([0.0, 0.3, 1.4, -0.2, 1.2, 0.0])
FOLDED = np.array([0.0, 0.0, 2.8, 0.0, 0.0, 0.0])
MARGIN_M = 0.01
PARTS = np.linspace(0.0, 1.0, 201)

numbers = st.floats(-1.0, 1.0).map(lambda number: round(number, 3))
segments = st.lists(numbers, min_size=6, max_size=6).map(
    lambda numbers: np.reshape(numbers, (2, 3))
)


def points_of(segment: FloatArray) -> FloatArray:
    points: FloatArray = segment[0] + PARTS[:, None] * (segment[1] - segment[0])
    return points


@given(segments, segments)
def test_segments_are_as_far_apart_as_their_nearest_points(
    first: FloatArray, second: FloatArray
) -> None:
    sampled = np.linalg.norm(points_of(first)[:, None] - points_of(second), axis=-1).min()
    distance = float(np.linalg.norm(segment_ways(first, second)))
    assert distance == pytest.approx(np.linalg.norm(segment_ways(second, first)), abs=1e-6)
    assert sampled - 0.02 < distance < sampled + 1e-6


@given(segments, st.lists(st.floats(0.05, 1.0), min_size=3, max_size=3))
def test_a_box_is_as_far_away_as_its_nearest_point(segment: FloatArray, size: list[float]) -> None:
    pose, halves = pose_of([0.3, -0.2, 0.1], [0.4, -0.3, 1.0]), 0.5 * np.array(size)
    beyond = np.abs((points_of(segment) - pose[:3, 3]) @ pose[:3, :3]) - halves
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    sampled = np.where(outside > 0.0, outside, beyond.max(axis=1)).min()
    distance = float(box_distances(segment[None], pose[None], halves[None])[0, 0])
    assert distance == pytest.approx(sampled, abs=0.01)


SHAPES = {
    "box": ([0.1, 0.2, 0.05], 0.0, 0.0),
    "cylinder": ([0.0, 0.0, 0.2], 0.1, 0.0),
    "capsule": ([0.0, 0.0, 0.2], 0.0, 0.1),
    "sphere": ([0.0, 0.0, 0.0], 0.0, 0.15),
}


def placed(shape: str, pose: FloatArray) -> Shapes:
    halves, disc, ball = SHAPES[shape]
    own = np.array([halves]), np.array([disc]), np.array([ball])
    return Shapes(pose[None, :3, 3], pose[None, :3, :3], *own)


def points_in(shape: str, pose: FloatArray) -> FloatArray:
    """Points of a body, drawn by its definition: many on its surface."""
    random, count = np.random.default_rng(3), 2000
    halves, disc, ball = SHAPES[shape]
    box = random.uniform(-1.0, 1.0, (count, 3))
    box = np.where(random.random((count, 3)) < 0.5, np.sign(box), box) * halves
    around = random.uniform(-np.pi, np.pi, count)
    flat = np.stack([np.cos(around), np.sin(around), np.zeros(count)], axis=1)
    turned = random.normal(size=(count, 3))
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    points: FloatArray = (box + disc * flat + ball * turned) @ pose[:3, :3].T + pose[:3, 3]
    return points


@pytest.mark.parametrize("first", SHAPES)
@pytest.mark.parametrize("second", SHAPES)
def test_bodies_are_never_nearer_than_their_gap(first: str, second: str) -> None:
    random = np.random.default_rng(4)
    for _ in range(8):
        one = pose_of([0.0, 0.0, 0.0], random.uniform(-2.0, 2.0, 3).tolist())
        other = pose_of(
            random.uniform(-0.5, 0.5, 3).tolist(), random.uniform(-2.0, 2.0, 3).tolist()
        )
        gap = widest_gaps(placed(first, one), placed(second, other), other[None, :3, 3])[0]
        places = points_in(first, one)[:, None, :] - points_in(second, other)[None, ::10]
        assert gap <= np.sqrt((places**2).sum(axis=-1)).min() + 1e-9


def test_bodies_beside_each_other_have_their_exact_gap() -> None:
    disc, beside, above = (
        pose_of(xyz, [0.0, 0.0, 0.0]) for xyz in ([0] * 3, [0.5, 0, 0], [0, 0, 1])
    )
    for pose, gap in ((beside, 0.5 - 0.1 - 0.1), (above, 1.0 - 0.2 - 0.05)):
        found = widest_gaps(placed("cylinder", disc), placed("box", pose), pose[None, :3, 3])
        assert found[0] == pytest.approx(gap)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_plane_is_as_far_away_as_the_nearest_point(shape: str) -> None:
    pose, normal = pose_of([0.3, -0.2, 0.4], [0.4, -0.3, 1.0]), np.array([0.0, 0.6, 0.8])
    distance = plane_distances(placed(shape, pose), normal[None], np.array([0.05]))[0, 0]
    nearest = (points_in(shape, pose) @ normal).min() - 0.05
    assert nearest - 0.01 < distance <= nearest + 1e-9


def test_a_body_holds_all_points_of_a_mesh() -> None:
    points = np.random.default_rng(1).normal(size=(200, 3)) * [0.3, 0.05, 0.08]
    corners = np.array(list(itertools.product([0.0, 0.2], [0.0, 0.2], [0.0, 0.05])))
    for cloud in (points, points * 0.1 + 1.0, points[:4], corners):
        body = enclosing_body(cloud)
        shapes = Shapes(
            body.pose[None, :3, 3],
            body.pose[None, :3, :3],
            body.halves[None],
            np.array([body.disc_m]),
            np.array([body.ball_m]),
        )
        normals = np.random.default_rng(2).normal(size=(50, 3))
        for normal in normals / np.linalg.norm(normals, axis=1, keepdims=True):
            reach = shapes.middles[0] @ normal + shapes.reach(normal)[0]
            assert (cloud @ normal).max() <= reach + 1e-9
        assert body.ball_m < np.ptp(cloud)
    assert enclosing_body(corners).halves.prod() == pytest.approx(0.1 * 0.1 * 0.025)


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
        self.tool = robot.feature(ToolGroups).only
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


def test_the_body_of_the_chosen_tool_counts(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text(
        "extends: cr3a\nname: arm\ntool_space:\n"
        "  tools:\n    probe: {xyz_m: [0, 0, 0.2], radius_m: 0.02}\n"
        "    frame: {xyz_m: [0, 0, 0.2]}\n"
        "  collisions: {planes: {floor: {normal: [0, 0, 1], distance_m: 0.0}}}\n",
        encoding="utf-8",
    )
    with open_robot(file, "sim", clock=SteppedClock()) as robot:
        arm = Arm(robot)
        go(arm.tool, BENT)
        down = pose_of(rpy=[np.pi, 0.0, 0.0])
        down[:3, 3] = [-0.35, -0.1, 0.17]  # of the link
        goal = arm.tool.at_link.inverse(down, BENT)
        for chosen, is_accepted in (("", True), ("frame", True), ("probe", False)):
            arm.tool.select_tool(chosen)
            if is_accepted:
                arm.follower.check(arm.request(goal))
            else:
                with pytest.raises(TrajectoryRejected, match="tool probe and floor would be"):
                    arm.follower.check(arm.request(goal))


def test_a_move_takes_the_first_posture_without_a_collision(arm: Arm) -> None:
    kinematics, random = arm.tool.at_link, np.random.default_rng(3)
    while True:  # a pose whose nearest posture cannot be reached freely, and another one can
        pose = kinematics.forward(random.uniform(-2.0, 2.0, 6))
        try:
            nearest, *others = kinematics.solutions(pose, arm.position)
        except Unreachable:
            continue
        if not is_free(arm, nearest) and any(is_free(arm, other) for other in others):
            break
    motion = arm.tool.plan_move(pose)
    assert motion.positions[-1] != pytest.approx(nearest)
    arm.follower.check(motion.request(arm.tool.group.joint_names))


def is_free(arm: Arm, goal: FloatArray) -> bool:
    motion = arm.tool.plan_joints(goal)
    try:
        arm.follower.check(motion.request(arm.tool.group.joint_names))
    except TrajectoryRejected:
        return False
    return True


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
        assert arm.position == pytest.approx(before, abs=1e-6), "it is at rest"
        stream.send(away.tolist())
        arm.run(200)
        assert stream._stage.status.code is ServoCode.NO_WARNING
    assert arm.collisions.distances(arm.position[None]).min() > nearest + 0.01


TOWARDS = np.array([0.0, 0.5, 0.0, 0.0, 0.0, 0.0])
CURVED = np.array([0.25, 0.4, -0.1, 0.0, 0.8, 0.5])
NEAR = PoseCommand(pose_of([-0.577, -0.121, 0.489], [-0.076, 0.37, -1.598]))  # as at ``BENT``
THERE = PoseCommand(pose_of([0.2, 0.9, 0.4], [0.0, 2.0, 0.0]))


@pytest.mark.parametrize("periods", [1, 5, 20], ids=lambda periods: f"every {periods}")
@pytest.mark.parametrize(
    "command",
    [
        ToolTwist(TOWARDS),
        ToolTwist(CURVED),
        ToolTwist(CURVED, in_tool=True),
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
    path.write_text(
        "extends: palletiser\nname: bare\ntool_space: {collisions: {}}\n", encoding="utf-8"
    )
    with pytest.raises(
        DescriptorError,
        match=r"bare.yaml:3: tool_space.collisions: without this guard the robot does not run: "
        r".*no link has a shape",
    ):
        build_robot(path, "sim")


def test_what_is_not_checked_is_listed() -> None:
    box = "{near: {xyz_m: [0, 0, 0.075], size_m: [0.02, 0.02, 0.02]}}"
    keys = f"{{boxes: {box}, not_checked: [[base_link, link3]]}}"
    overrides = [parse_override(f"tool_space.collisions={keys}")]
    descriptor = load_robot_descriptor("cr3a", overrides=overrides)
    [(what, check)] = check_collisions(descriptor)
    assert what == "collisions"
    assert [*check()] == [
        "collisions of link1 and near are not checked: they are too close in nearly every posture",
        "collisions of base_link and link3 are not checked: the file says so",
    ]
    assert not [*check_collisions(load_robot_descriptor("cr3a"))]


def test_links_of_other_groups_are_left_out() -> None:
    path = Path(__file__).parents[3] / "robots/dual_cr3a/dual_cr3a.urdf"
    urdf = read_urdf(path)
    moved = [joint.name for joint in urdf.joints if joint.type == "revolute"]
    left, right = moved[:6], moved[6:12]
    from robotd_tool_space import Chain

    chain = Chain.of_urdf(urdf, left, urdf.joint[left[-1]].child, right)
    links = Bodies.of_urdf(urdf, path, chain, right).links
    assert not {urdf.joint[name].child for name in right} & {*links}
    assert {urdf.joint[name].child for name in left} <= {*links}


@pytest.mark.parametrize("name", ["cr3a", "cr5a", "scara"])
def test_another_program_finds_no_contact_where_a_posture_is_free(name: str) -> None:
    """MuJoCo reads the URDF by itself, and knows contacts of cylinders and boxes exactly."""
    descriptor = load_robot_descriptor(name)
    kinematics = Kinematics.of_descriptor(descriptor, "joints")
    ours = Collisions.of(descriptor, kinematics, CollisionSettings(margin_m=0.0))
    model = mujoco.MjModel.from_xml_path(str(descriptor.urdf))
    data = mujoco.MjData(model)
    columns = [int(model.joint(joint).qposadr[0]) for joint in kinematics.chain.names]

    def depth(body: int) -> int:  # in the chain: each body hangs on the one before
        return 0 if body == 0 else 1 + depth(int(model.body_parentid[body]))

    def touches(row: FloatArray) -> bool:
        data.qpos[:] = 0.0
        data.qpos[columns] = row
        mujoco.mj_forward(model, data)
        pairs = [model.geom_bodyid[contact.geom] for contact in data.contact]
        # Fingers at the end of an arm are in one place with their link here.
        return any(abs(depth(first) - depth(second)) > 1 for first, second in pairs)

    lower, upper = np.maximum(kinematics.lower, -np.pi), np.minimum(kinematics.upper, np.pi)
    positions = np.random.default_rng(5).uniform(lower, upper, (400, len(lower)))
    free = (ours.distances(positions) > 0.0).all(axis=1)
    touching = np.array([touches(row) for row in positions])
    assert not (free & touching).any()
    assert np.mean(free | touching) > 0.98, "nearly all others are free"


@pytest.mark.parametrize("name", ["cr3a", "cr5a", "scara", "so101", "omx", "dual_cr3a"])
def test_every_pair_of_a_shipped_arm_is_checked(name: str) -> None:
    descriptor = load_robot_descriptor(name)
    for group in descriptor.joint_groups:
        kinematics = Kinematics.of_descriptor(descriptor, group)
        assert Collisions.of(descriptor, kinematics, CollisionSettings()).left_out == ()


def test_pairs_that_the_file_names_are_not_checked(collisions: Collisions) -> None:
    descriptor = load_robot_descriptor("cr3a")
    kinematics = Kinematics.of_descriptor(descriptor, "joints")
    assert ("base_link", "link2") in collisions.names
    settings = CollisionSettings(not_checked=[("link2", "base_link")])
    assert ("base_link", "link2") not in Collisions.of(descriptor, kinematics, settings).names
    unknown = CollisionSettings(not_checked=[("link2", "base")])
    with pytest.raises(DescriptorError, match=r"not_checked: no link 'base' in cr3a.urdf"):
        Collisions.of(descriptor, kinematics, unknown)
