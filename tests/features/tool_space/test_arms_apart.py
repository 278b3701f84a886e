"""Two arms on one base: goals that are rejected, and motion that is stopped before they meet.

Distances are judged by MuJoCo, which reads the URDF by itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from robotd import Robot, open_robot
from robotd.api import CommandMode, FloatArray, Operation, Profile, load_robot_descriptor
from robotd.api.models import parse_override
from robotd.api.robots import TrajectoryRequest
from robotd.clock.simulated import SteppedClock
from robotd.control.loop.setpoint_source import Outcome
from robotd.device.axes import Jog
from robotd.motion.rejection import TrajectoryRejected
from robotd_tool_space import SceneObject, ToolGroups, pose_of
from robotd_tool_space.collision.between_arms import BetweenArms
from robotd_tool_space.collision.collisions import Collisions
from robotd_tool_space.collision.unchecked_pairs import check_collisions
from robotd_tool_space.geometry.kinematics import Kinematics
from robotd_tool_space.settings import CollisionSettings

MARGIN_M = 0.01
REACH_M = 0.5  # up to which MuJoCo looks
DUAL = Path(__file__).parents[3] / "robots/dual_cr3a/dual_cr3a.urdf"
HOME = np.zeros(6)


class Pair:
    """The two arms, in stepped time, and MuJoCo's distance between them in each period."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.tools = robot.feature(ToolGroups)
        self.nearest = np.inf
        self._model = mujoco.MjModel.from_xml_path(str(DUAL))
        self._data = mujoco.MjData(self._model)
        names = [joint.name for joint in robot.descriptor.joints]
        self._columns = [int(self._model.joint(name).qposadr[0]) for name in names]
        sides = [
            [geom for geom in range(self._model.ngeom) if self._side(geom) == side]
            for side in ("left_link", "right_link")
        ]
        self._geoms = [(one, other) for one in sides[0] for other in sides[1]]

    def _side(self, geom: int) -> str:
        return str(self._model.body(self._model.geom_bodyid[geom]).name).rstrip("123456")

    def distance(self, positions: FloatArray) -> float:
        """Return MuJoCo's distance of the arms at (12,), at most ``REACH_M``."""
        self._data.qpos[self._columns] = positions
        mujoco.mj_forward(self._model, self._data)
        return min(
            mujoco.mj_geomDistance(self._model, self._data, one, other, REACH_M, None)
            for one, other in self._geoms
        )

    def run(self, periods: int) -> None:
        """Step, and keep the least distance of what is commanded."""
        for _ in range(periods):
            self.robot.step(1)
            self.nearest = min(self.nearest, self.distance(self.robot.image.position_command))

    def request(self, side: str, goal: FloatArray, seconds: float = 2.0) -> TrajectoryRequest:
        names = self.tools.of(side).group.joint_names
        return TrajectoryRequest(names, np.array([seconds]), np.array([goal]))

    def go(self, side: str, goal: FloatArray) -> Outcome | None:
        with self.tools.of(side).group.follower.follow(self.request(side, goal)) as execution:
            while execution.outcome is None:
                self.run(10)
        return execution.outcome

    def position(self, side: str) -> FloatArray:
        axes = list(self.tools.of(side).group.joint_axes)
        return self.robot.image.position_command[axes].copy()


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("arms") / "robot.yaml"
    text = "extends: dual_cr3a\nname: arms\ntool_space: {collisions: {}}\n"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture
def pair(file: Path) -> Iterator[Pair]:
    with open_robot(file, "sim", clock=SteppedClock()) as robot:
        yield Pair(robot)


@pytest.fixture(scope="module")
def between(file: Path) -> BetweenArms:
    descriptor = load_robot_descriptor(file)
    settings = CollisionSettings(margin_m=0.0)
    first, second = (
        Collisions.of(descriptor, Kinematics.of_descriptor(descriptor, side), settings)
        for side in ("left", "right")
    )
    return BetweenArms(first, second)


# Postures of both arms that MuJoCo, too, finds 25 to 60 mm deep in each other.
MEETINGS = [
    ([-1.10, -1.34, -1.04, -0.57, -0.84, 1.01], [1.55, -1.90, -0.34, -0.58, 1.37, 1.53]),
    ([-0.92, -1.98, -1.20, 0.69, -1.18, -0.36], [1.68, -1.61, -1.62, -1.27, -1.04, 0.30]),
    ([-0.05, -1.80, -1.71, -0.81, -0.34, 0.87], [1.00, -1.73, -1.64, 1.65, 1.34, 1.45]),
    ([0.71, -1.67, -0.35, -1.56, -0.37, 0.76], [-0.10, -1.86, -1.16, -0.11, -0.35, 1.11]),
    ([1.55, 1.84, 1.45, 1.23, 0.44, -0.21], [1.77, -1.71, -1.82, 0.25, 1.29, -0.16]),
    ([-0.72, -1.88, -1.28, -0.77, -0.30, -1.57], [-1.94, 1.65, 1.29, 0.09, 0.92, 1.11]),
    ([0.73, -1.85, -0.45, -1.35, -0.64, -0.53], [-0.33, -1.43, -1.39, 0.36, 1.03, -0.52]),
]
meetings = pytest.mark.parametrize(
    ("left", "right"), [tuple(map(np.array, meeting)) for meeting in MEETINGS]
)


def test_mujoco_finds_no_contact_where_two_arms_are_apart(pair: Pair, between: BetweenArms) -> None:
    middle = np.array([np.concatenate(meeting) for meeting in MEETINGS])
    random = np.random.default_rng(5)
    positions = middle[random.integers(len(middle), size=300)] + random.normal(0, 0.3, (300, 12))
    apart = between.distances(positions).min(axis=1)
    theirs = np.array([pair.distance(row) for row in positions])
    assert (theirs < 0.0).sum() > 30
    assert not ((apart > 0.0) & (theirs < 0.0)).any()
    assert (apart <= theirs + 1e-6).all(), "never more than the true distance"
    assert np.mean((apart > 0.0) | (theirs < 0.0)) > 0.9, "nearly all others touch"


@meetings
def test_a_goal_into_an_arm_at_rest_is_rejected(
    pair: Pair, left: FloatArray, right: FloatArray
) -> None:
    assert pair.go("right", right) is Outcome.SUCCEEDED
    with pytest.raises(TrajectoryRejected, match=r"left_link\d and right_link\d would "):
        pair.go("left", left)
    assert (pair.position("left") == HOME).all()
    assert pair.nearest > MARGIN_M - 1e-4


@meetings
def test_two_arms_that_move_are_stopped_before_they_meet(
    pair: Pair, left: FloatArray, right: FloatArray
) -> None:
    """Each goal alone is free: where the other arm will be is not known when it is accepted."""
    follow = {side: pair.tools.of(side).group.follower.follow for side in ("left", "right")}
    with ExitStack() as stack:
        goals = [
            stack.enter_context(follow[side](pair.request(side, goal)))
            for side, goal in (("left", left), ("right", right))
        ]
        while any(goal.outcome is None for goal in goals):
            pair.run(10)
    assert Outcome.STOPPED in {goal.outcome for goal in goals}
    stopped = next(goal for goal in goals if goal.outcome is Outcome.STOPPED)
    assert "would" in stopped.message
    assert "left_link" in stopped.message
    assert "right_link" in stopped.message
    assert 0.0 < pair.nearest < 0.15
    assert {pair.go("left", HOME), pair.go("right", HOME)} == {Outcome.SUCCEEDED}


def test_a_goal_that_was_free_before_is_checked_again(pair: Pair) -> None:
    left, right = map(np.array, MEETINGS[0])
    pair.tools.of("left").group.follower.check(pair.request("left", left))
    assert pair.go("right", right) is Outcome.SUCCEEDED
    with pytest.raises(TrajectoryRejected, match="would"):
        pair.go("left", left)


def test_a_stream_stops_before_the_other_arm_and_leaves_it(pair: Pair) -> None:
    left, right = map(np.array, MEETINGS[2])
    pair.go("right", right)
    with pair.tools.of("left").group.stream(timeout_s=100.0) as stream:
        for _ in range(40):  # a client that goes on
            stream.send(left)
            pair.run(25)
        near = pair.distance(pair.robot.image.position_command)
        assert MARGIN_M - 1e-3 < pair.nearest <= near < 0.1
        before = pair.position("left")
        pair.run(50)
        assert pair.position("left") == pytest.approx(before, abs=1e-6), "it is at rest"
        stream.send(HOME)
        pair.run(1500)
    assert pair.position("left") == pytest.approx(HOME, abs=1e-3)


@pytest.mark.parametrize(("meeting", "offset"), [(0, -0.8), (0, 0.8), (3, -0.8), (6, -0.8)])
def test_a_jog_stops_before_the_other_arm(pair: Pair, meeting: int, offset: float) -> None:
    left, right = map(np.array, MEETINGS[meeting])
    left[0] += offset
    assert pair.go("left", left) is Outcome.SUCCEEDED
    assert pair.go("right", right) is Outcome.SUCCEEDED
    pair.robot.axes.set_command_mode(0, CommandMode.VELOCITY)
    pair.robot.axes.jog([Jog(0, Profile(-np.sign(offset), 4.0, 4.0))])
    pair.run(2000)
    assert pair.robot.image.operation[0] == Operation.IDLE
    assert 0.0 < pair.nearest < 0.1
    assert abs(pair.position("left")[0] - left[0]) > 0.2, "it has moved"


def test_what_a_tool_carries_is_kept_away_from_the_other_arm(pair: Pair) -> None:
    left, right = map(np.array, MEETINGS[0])
    scene = pair.tools.of("right").scene
    assert scene is not None
    pair.go("right", right)
    check = pair.tools.of("left").group.follower.check
    nearly = 0.8 * left  # of the way
    check(pair.request("left", nearly))
    tip = pair.tools.of("left").at_link.forward(nearly)[:3, 3]
    assert scene.add(SceneObject("beam", "sphere", (0.1,), pose_of(tip))) == "beam added"
    check(pair.request("left", nearly))  # it is in the scene of the other arm only
    scene.attach("beam")
    with pytest.raises(TrajectoryRejected, match=r"left_link\d and beam would"):
        check(pair.request("left", nearly))


def test_pairs_that_the_file_names_are_left_out(between: BetweenArms) -> None:
    settings = CollisionSettings(not_checked=[("right_link6", "left_link6")])
    first, second = (
        replace(collisions, settings=settings) for collisions in (between.first, between.second)
    )
    names = BetweenArms(first, second).names
    assert ("left_link6", "right_link6") not in names
    assert ("left_link6", "right_link5") in names


def test_arms_on_bases_that_move_are_named_as_not_checked(file: Path) -> None:
    keys = parse_override("tool_space.collisions={}")
    checks = dict(check_collisions(load_robot_descriptor("so101", overrides=[keys])))
    assert [*checks["collisions of arms with each other"]()] == [
        (
            "collisions of arm with gripper are not checked: their bases are base_link and"
            " gripper_link, and one of them moves"
        )
    ]
    checks = dict(check_collisions(load_robot_descriptor(file)))
    assert not [*checks["collisions of arms with each other"]()]
