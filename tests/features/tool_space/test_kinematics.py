"""Kinematics of tool space, against the URDF reader, against differences, and against optik."""

from __future__ import annotations

import numpy as np
import optik
import pytest
from tests.features.tool_space.arms import FILES, file_of, kinematics_of, random_positions

from robotd.api import DescriptorError, InvalidArgument, load_robot_descriptor, read_urdf
from robotd_tool_space import (
    Chain,
    Kinematics,
    Unreachable,
    UnreachableCause,
    pose_differences,
    pose_of,
    quaternion_pose,
    rotation_matrices,
    rotation_vectors,
    rpy_of,
)

REVOLUTE_ARMS = ("cr3a", "six_axis")  # optik knows no continuous joint


@pytest.mark.parametrize("name", FILES)
def test_forward_is_the_pose_of_the_urdf_reader(name: str) -> None:
    arm, urdf = kinematics_of(name), read_urdf(file_of(name))
    positions = random_positions(arm, 20)
    poses = arm.forward(positions)
    for row, pose in zip(positions, poses, strict=True):
        named = dict(zip(arm.chain.names, row.tolist(), strict=True))
        assert pose == pytest.approx(urdf.pose(arm.chain.link, named), abs=1e-12)
        assert arm.forward(row) == pytest.approx(pose, abs=1e-15), "one or many are the same"


@pytest.mark.parametrize("name", FILES)
def test_the_jacobian_is_the_derivative_of_the_pose(name: str) -> None:
    arm, step = kinematics_of(name), 1e-6
    for row in random_positions(arm, 5):
        around = [arm.forward(row + sign * step * np.eye(len(row))) for sign in (1.0, -1.0)]
        numeric = pose_differences(around[1], around[0]) / (2.0 * step)
        assert arm.jacobian(row) == pytest.approx(numeric.T, abs=1e-6)


@pytest.mark.parametrize("name", REVOLUTE_ARMS)
def test_forward_and_jacobian_agree_with_an_independent_library(name: str) -> None:
    arm = kinematics_of(name)
    other = optik.Robot.from_urdf_file(str(file_of(name)), arm.chain.base, arm.chain.link)
    for row in random_positions(arm, 20):
        pose = arm.forward(row)
        assert pose == pytest.approx(np.array(other.fk(row)), abs=1e-9)
        # Its Jacobian is that of the tool's own axes.
        turned = np.kron(np.eye(2), pose[:3, :3]) @ np.array(other.joint_jacobian(row))
        assert arm.jacobian(row) == pytest.approx(turned, abs=1e-9)


@pytest.mark.parametrize("name", FILES)
def test_nearly_every_reachable_pose_is_reached(name: str) -> None:
    arm = kinematics_of(name)
    positions = random_positions(arm, 100)
    middle = random_positions(arm, 2000).mean(axis=0)
    missed = 0
    for row in positions:
        target = arm.forward(row)
        try:
            found = arm.inverse(target, middle)
        except Unreachable:
            missed += 1
            continue
        assert (found >= arm.lower).all()
        assert (found <= arm.upper).all()
        assert arm.forward(found) == pytest.approx(target, abs=2e-6)
    assert missed == 0


def test_solutions_agree_with_an_independent_library() -> None:
    arm = kinematics_of("cr3a")
    other = optik.Robot.from_urdf_file(str(file_of("cr3a")), "base_link", "link6")
    config = optik.SolverConfig(max_time=60.0, tol_f=1e-16)
    for row, start in zip(random_positions(arm, 15), random_positions(arm, 15, 2), strict=True):
        found = other.ik(config, arm.forward(row), start)
        assert found is not None
        mine = arm.solutions(arm.forward(row), np.array(found[0]))
        assert mine[0] == pytest.approx(np.array(found[0]), abs=1e-3)


def test_a_seed_beside_the_solution_leads_to_it() -> None:
    arm = kinematics_of("cr3a")
    for row in random_positions(arm, 50):
        if arm.singularity(row) < 0.05:
            continue
        seed = np.clip(row + 0.01, arm.lower, arm.upper)
        assert arm.inverse(arm.forward(row), seed) == pytest.approx(row, abs=1e-4)


def test_a_joint_of_two_turns_keeps_the_turn_of_the_seed() -> None:
    arm = kinematics_of("cr3a")
    row = np.array([0.3, -0.4, 1.2, 0.2, 1.0, 0.5])
    for turn, expected in ((0.0, 0.5), (-6.0, 0.5 - 2 * np.pi), (4.0, 0.5)):
        seed = row.copy()
        seed[5] = turn
        found = arm.solutions(arm.forward(row), seed)
        same = found[np.abs(found[:, :5] - row[:5]).max(axis=1) < 1e-3]
        assert same[0, 5] == pytest.approx(expected, abs=1e-4)


def test_a_scara_has_two_postures() -> None:
    scara = kinematics_of("scara")
    row = np.array([0.4, 0.8, 0.05, 0.3])
    found = scara.solutions(scara.forward(row), row)
    assert len(found) == 2, "elbow left and right"
    assert found[0] == pytest.approx(row, abs=1e-6)
    assert found[1][1] == pytest.approx(-0.8, abs=1e-6)


def test_the_same_question_has_the_same_answer() -> None:
    arm = kinematics_of("seven_axis")
    target, seed = arm.forward(random_positions(arm, 1)[0]), random_positions(arm, 1, 3)[0]
    assert (arm.inverse(target, seed) == arm.inverse(target, seed)).all()


def test_reasons() -> None:
    arm = kinematics_of("cr3a")
    seed = np.array([0.1, 0.2, 1.0, 0.3, 1.0, 0.2])
    with pytest.raises(Unreachable, match=r"out of reach: the tool comes within \d+\.\d mm") as far:
        arm.inverse(pose_of([2.0, 0.0, 0.3]), seed)
    assert far.value.cause is UnreachableCause.OUT_OF_REACH
    narrow = kinematics_of("cr3a")
    object.__setattr__(narrow, "upper", np.array([3.14, 3.14, 0.5, 3.14, 3.14, 6.28]))
    object.__setattr__(narrow, "lower", np.array([-3.14, -3.14, -0.5, -3.14, -3.14, -6.28]))
    folded = arm.forward(np.array([0.1, 0.2, 2.5, 0.3, 1.0, 0.2]))
    with pytest.raises(
        Unreachable, match=r"joint3 would have to be at -?\d.* rad, its limit"
    ) as no:
        narrow.inverse(folded, np.zeros(6))
    assert no.value.cause is UnreachableCause.LIMITS
    edge = arm.forward(np.zeros(6))
    edge[:3, :3] = edge[:3, :3] @ rotation_matrices(np.array([0.0, 1.0, 0.0]))
    with pytest.raises(Unreachable) as turned:
        arm.inverse(edge, seed)
    assert turned.value.cause in (UnreachableCause.ORIENTATION, UnreachableCause.OUT_OF_REACH)


def test_the_end_of_a_slide_is_named() -> None:
    scara, seed = kinematics_of("scara"), np.array([0.4, 0.8, 0.05, 0.3])
    above, below = (pose_of([0.0, 0.0, z]) @ scara.forward(seed) for z in (0.07, -0.2))
    for target, at, limit in ((above, "-0.02", "0"), (below, "0.25", "0.15")):
        text = rf"^joint3 would have to be at {at} m, its limit is {limit} m$"
        with pytest.raises(Unreachable, match=text) as end:
            scara.inverse(target, seed)
        assert end.value.cause is UnreachableCause.LIMITS
    beyond = pose_of([0.5, 0.0, 0.0]) @ scara.forward(seed)
    with pytest.raises(Unreachable, match=r"^out of reach: the tool comes within 4\d\d\.\d mm"):
        scara.inverse(beyond, seed)


def test_what_the_structure_rules_out_is_named() -> None:
    scara = kinematics_of("scara")
    row = np.array([0.4, 0.8, 0.05, 0.3])
    tilted = scara.forward(row) @ pose_of(rpy=[0.2, 0.0, 0.0])
    reason = (
        r"rotation about [xy] of the base by -?0\.\d* rad, which no joint of the arm can;"
        r" the arm moves it in x, y, z, rotation about z$"
    )
    with pytest.raises(Unreachable, match=reason):
        scara.inverse(tilted, row)
    assert len(scara.task.chosen) == 4
    assert len(kinematics_of("gantry").task.chosen) == 3
    assert kinematics_of("cr3a").task.is_whole


@pytest.mark.parametrize(
    ("pose", "text"),
    [
        (np.eye(3), r"shape \(3, 3\), must be \(4, 4\)"),
        (np.full((4, 4), np.nan), "not finite"),
        (2.0 * np.eye(4), "no rotation matrix"),
        (np.diag([1.0, 1.0, -1.0, 1.0]), "no rotation matrix"),
    ],
)
def test_what_is_no_pose_is_rejected(pose: np.ndarray, text: str) -> None:
    arm = kinematics_of("cr3a")
    with pytest.raises(InvalidArgument, match=text):
        arm.inverse(pose, np.zeros(6))


def test_a_seed_that_is_not_finite_is_rejected() -> None:
    arm = kinematics_of("cr3a")
    with pytest.raises(InvalidArgument, match="must be finite positions of joint1, "):
        arm.inverse(np.eye(4), np.array([0.0, np.nan, 0.0, 0.0, 0.0, 0.0]))


def test_a_tool_moves_the_pose_and_the_jacobian() -> None:
    arm = kinematics_of("cr3a")
    offset = pose_of([0.0, 0.05, 0.2], [0.1, 0.2, 0.3])
    with_tool, row = arm.with_tool(offset), random_positions(arm, 1)[0]
    assert with_tool.forward(row) == pytest.approx(arm.forward(row) @ offset)
    target = with_tool.forward(row)
    assert with_tool.forward(with_tool.inverse(target, row)) == pytest.approx(target, abs=2e-6)


def test_two_arms_have_chains_of_their_own() -> None:
    dual = load_robot_descriptor("dual_cr3a")
    left, right = (Kinematics.of_descriptor(dual, group) for group in ("left", "right"))
    assert (left.chain.link, right.chain.link) == ("left_link6", "right_link6")
    assert left.chain.names != right.chain.names


def test_a_foreign_joint_within_the_chain_is_an_error() -> None:
    urdf = read_urdf(file_of("cr3a"))
    with pytest.raises(
        DescriptorError, match="joint 'joint3' of another group is between 'joint2'"
    ):
        Chain.of_urdf(urdf, ["joint1", "joint2", "joint4", "joint5"], "link6", ["joint3"])
    part = Chain.of_urdf(urdf, ["joint4", "joint5"], "link6", ["joint3"])
    assert part.base == "link3"


def test_rotations_there_and_back() -> None:
    random = np.random.default_rng(2)
    vectors = random.normal(size=(200, 3))
    vectors *= (np.linspace(0.0, np.pi, 200) / np.linalg.norm(vectors, axis=1))[:, None]
    matrices = rotation_matrices(vectors)
    back = rotation_matrices(rotation_vectors(matrices))
    assert back == pytest.approx(matrices, abs=1e-7)
    for rpy in random.uniform(-1.5, 1.5, (20, 3)):
        assert rpy_of(pose_of(rpy=rpy)) == pytest.approx(rpy, abs=1e-9)
    up = rpy_of(pose_of(rpy=[0.3, np.pi / 2, 0.5]))
    assert pose_of(rpy=up) == pytest.approx(pose_of(rpy=[0.3, np.pi / 2, 0.5]), abs=1e-9)


def test_quaternions() -> None:
    half = quaternion_pose([1.0, 2.0, 3.0], [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)])
    assert half == pytest.approx(pose_of([1.0, 2.0, 3.0], [0.0, 0.0, np.pi / 2]))
    with pytest.raises(InvalidArgument, match="length 0, must be 1"):
        quaternion_pose([0.0] * 3, [0.0] * 4)
    with pytest.raises(InvalidArgument, match="not finite"):
        quaternion_pose([np.nan, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0])
