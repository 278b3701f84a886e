"""A scene that changes: what is added, moved, carried and removed counts for all motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from tests.features.tool_space.arms import go

from robotd import Robot, open_robot
from robotd.api import DescriptorError, FloatArray, InvalidArgument, NotReady, load_robot_descriptor
from robotd.api.robots import Outcome, TrajectoryRejected, TrajectoryRequest
from robotd.clock.simulated import SteppedClock
from robotd_tool_space import CollisionGuard, ToolGroups
from robotd_tool_space.collision.collisions import Collisions
from robotd_tool_space.collision.scene import MAX_OBJECTS, Scene
from robotd_tool_space.collision.scene_object import SceneObject
from robotd_tool_space.geometry.kinematics import Kinematics
from robotd_tool_space.geometry.rotations import pose_of
from robotd_tool_space.settings import CollisionSettings
from robotd_tool_space.streams.servo_status import ServoCode

BENT = np.array([0.0, 0.3, 1.4, -0.2, 1.2, 0.0])
MARGIN_M = 0.01


def item(
    name: str, shape: str, size: tuple[float, ...], *place: float, attached: bool = False
) -> SceneObject:
    return SceneObject(name, shape, size, pose_of(place or (0.0, 0.0, 0.0)), attached=attached)


class Arm:
    """A robot on a stepped clock whose scene changes."""

    def __init__(self, robot: Robot) -> None:
        self.robot, self.tool = robot, robot.feature(ToolGroups).only
        scene = self.tool.scene
        assert scene is not None
        self.scene: Scene = scene
        self.follower = self.tool.group.follower

    @property
    def position(self) -> FloatArray:
        return self.robot.image.position_command[:6].copy()

    @property
    def place(self) -> FloatArray:
        """Of the tool."""
        place: FloatArray = self.tool.at_link.forward(self.position)[:3, 3]
        return place

    def request(self, goal: FloatArray, seconds: float = 3.0) -> TrajectoryRequest:
        return TrajectoryRequest(self.tool.group.joint_names, np.array([seconds]), np.array([goal]))

    def distances(self, objects: list[SceneObject]) -> Collisions:
        descriptor, link = self.robot.descriptor, self.tool.at_link
        return Collisions.of(descriptor, link, CollisionSettings()).with_objects(objects)


def turned(angle: float) -> FloatArray:
    return BENT + np.array([angle, 0.0, 0.0, 0.0, 0.0, 0.0])


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "robot.yaml"
    path.write_text("extends: cr3a\nname: arm\ntool_space: {collisions: {}}\n", encoding="utf-8")
    return path


@pytest.fixture
def arm(file: Path) -> Iterator[Arm]:
    with open_robot(file, "sim", clock=SteppedClock()) as robot:
        arm = Arm(robot)
        go(arm.tool, BENT)
        yield arm


def post_at(arm: Arm, angle: float) -> SceneObject:
    """A post where the tool is after joint1 has turned by ``angle``."""
    x, y, _ = arm.tool.at_link.forward(turned(angle))[:3, 3]
    return item("post", "cylinder", (0.03, 1.0), x, y, 0.5)


@pytest.mark.parametrize("shape", ["cylinder", "sphere", "box", "plane"])
def test_what_is_added_rejects_goals_until_it_is_removed(arm: Arm, shape: str) -> None:
    place = arm.tool.at_link.forward(turned(1.0))[:3, 3]
    size = {"cylinder": (0.05, 0.4), "sphere": (0.1,), "box": (0.1, 0.2, 0.3), "plane": ()}[shape]
    pose = pose_of(place.tolist())
    if shape == "plane":  # its z points to the arm
        to_arm = arm.place - place
        pose = pose_of(place.tolist(), [0.0, np.pi / 2, float(np.arctan2(to_arm[1], to_arm[0]))])
    goal = arm.request(turned(1.0))
    arm.follower.check(goal)
    assert arm.scene.add(SceneObject("thing", shape, size, pose)) == "thing added"
    assert [one.name for one in arm.scene.objects] == ["thing"]
    with pytest.raises(TrajectoryRejected, match=" and thing would "):
        arm.follower.check(goal)
    guard = arm.robot.feature(CollisionGuard)
    with pytest.raises(InvalidArgument, match=" and thing would "):  # as programs ask
        guard.check_positions(arm.tool.group.name, "", np.array([BENT, turned(1.0)]))
    assert arm.scene.remove("thing") == "thing removed"
    arm.follower.check(goal)


def test_a_motion_under_way_stops_before_what_is_added_in_its_path(arm: Arm) -> None:
    added = post_at(arm, 1.5)
    with arm.follower.follow(arm.request(turned(2.0), 4.0)) as execution:
        arm.robot.step(600)
        text = arm.scene.add(added)
        assert "post added; motion is stopped: the scene has changed: at " in text
        passed = []
        while not execution.done:
            arm.robot.step(1)
            passed.append(arm.position)
    assert execution.outcome is Outcome.STOPPED
    assert " and post would " in execution.message
    assert arm.distances([added]).distances(np.array(passed)).min() > MARGIN_M
    travel = np.array(passed) - BENT
    assert np.abs(travel[:, 1:]).max() < 1e-9, "it stops on its path"
    assert 0.05 < travel[-1, 0] < 1.5


def test_a_motion_under_way_goes_on_where_nothing_is_in_its_path(arm: Arm) -> None:
    with arm.follower.follow(arm.request(turned(1.0))) as execution:
        arm.robot.step(600)
        assert arm.scene.add(post_at(arm, -1.0)) == "post added"
        while not execution.done:
            arm.robot.step(1)
    assert execution.outcome is Outcome.SUCCEEDED


def test_streams_and_twists_stop_before_what_is_added_meanwhile(arm: Arm) -> None:
    twist = np.zeros(6)
    twist[:2] = np.cross([0.0, 0.0, 0.2], arm.place)[:2]  # along the circle, at first
    added = item("post", "sphere", (0.05,), *(arm.place + 1.5 * twist[:3]))
    with arm.tool.stream(timeout_s=100.0) as stream:
        stream.send(twist.tolist())
        arm.robot.step(100)
        arm.scene.add(added)
        passed = []
        for _ in range(2000):
            arm.robot.step(1)
            passed.append(arm.position)
        assert stream._stage.status.code is ServoCode.HALT_FOR_COLLISION
        assert "and post would be" in stream.slow_reason
    assert not arm.robot.image.velocity_command[:6].any()
    assert arm.distances([added]).distances(np.array(passed)).min() > MARGIN_M - 1e-4


def test_an_arm_in_what_is_added_is_told_so_and_may_leave(arm: Arm) -> None:
    x, y, z = arm.place
    text = arm.scene.add(item("ball", "sphere", (0.1,), x, y, z - 0.12))
    assert text.startswith("ball added; ")
    assert "and ball touch already: only motion that leads away is possible" in text
    down, up = (arm.tool.plan_lines([arm.tool.pose_relative(z=travel)]) for travel in (-0.02, 0.1))
    with pytest.raises(TrajectoryRejected, match=" and ball would touch"):
        arm.follower.check(down.request(arm.tool.group.joint_names))
    arm.tool.execute(up)
    with pytest.raises(TrajectoryRejected, match=" and ball would "):
        arm.follower.check(arm.request(BENT))


def test_what_the_tool_carries_goes_with_it(arm: Arm) -> None:
    place = arm.place
    arm.scene.add(item("rod", "box", (0.02, 0.02, 0.5), place[0], place[1], place[2] - 0.27))
    floor = item("floor", "plane", (), 0.0, 0.0, place[2] - 0.56)
    arm.scene.add(floor)
    goal = BENT + np.array([0.0, 0.3, 0.0, 0.0, 0.0, 0.0])
    arm.scene.remove("rod")
    arm.follower.check(arm.request(goal))  # without it
    arm.scene.add(item("rod", "box", (0.02, 0.02, 0.5), place[0], place[1], place[2] - 0.27))
    assert arm.scene.attach("rod").startswith("rod attached")
    (carried,) = [one for one in arm.scene.objects if one.name == "rod"]
    assert carried.attached
    with pytest.raises(TrajectoryRejected, match="rod and floor would"):
        arm.follower.check(arm.request(goal))
    go(arm.tool, turned(0.5))
    assert arm.scene.detach("rod").startswith("rod detached")
    (left,) = [one for one in arm.scene.objects if one.name == "rod"]
    turn = np.array([np.cos(0.5), np.sin(0.5)])
    was = np.array([place[0], place[1]])
    there = [was[0] * turn[0] - was[1] * turn[1], was[0] * turn[1] + was[1] * turn[0]]
    assert left.pose[:2, 3] == pytest.approx(there, abs=1e-3)
    assert left.pose[2, 3] == pytest.approx(place[2] - 0.27, abs=1e-3)


def test_nothing_is_attached_while_the_arm_moves(arm: Arm) -> None:
    arm.scene.add(item("rod", "box", (0.02, 0.02, 0.1), 1.0, 1.0, 1.0))
    with arm.follower.follow(arm.request(turned(1.0))):
        arm.robot.step(300)
        with pytest.raises(NotReady, match="the joints move"):
            arm.scene.attach("rod")


def test_an_object_is_moved_and_replaced_by_its_name(arm: Arm) -> None:
    goal = arm.request(turned(1.0))
    arm.scene.add(post_at(arm, 1.0))
    assert arm.scene.move("post", pose_of([0.0, 0.0, 3.0])) == "post moved"
    arm.follower.check(goal)
    assert arm.scene.add(post_at(arm, 1.0)) == "post replaced"
    with pytest.raises(TrajectoryRejected):
        arm.follower.check(goal)
    assert arm.scene.remove() == "1 objects removed"
    assert arm.scene.objects == ()
    arm.follower.check(goal)


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        (item("", "sphere", (0.1,)), "name '': must have 1 to 64 characters"),
        (item("a", "spher", (0.1,)), r"a: no shape 'spher' \(available: .*did you mean 'sphere'"),
        (item("a", "box", (0.1, 0.1)), "a: size_m has 2 numbers, a box has 3"),
        (item("a", "sphere", (-0.1,)), "a: size_m has -0.1, must be above 0, to 100"),
        (item("a", "sphere", (float("nan"),)), "a: size_m has nan, must be above 0"),
        (item("a", "plane", (), attached=True), "a: a tool cannot carry a plane"),
        (SceneObject("a", "sphere", (0.1,), np.zeros((4, 4))), "pose of a has no rotation"),
        (item("link3", "sphere", (0.1,)), "'link3' is the name of a link or a tool"),
    ],
)
def test_what_cannot_be_is_rejected(arm: Arm, wrong: SceneObject, text: str) -> None:
    with pytest.raises(InvalidArgument, match=text):
        arm.scene.add(wrong)
    assert arm.scene.objects == ()


def test_names_that_are_not_there_are_errors(arm: Arm) -> None:
    arm.scene.add(item("post", "sphere", (0.1,), 2.0))
    for change in (arm.scene.remove, arm.scene.attach, arm.scene.detach):
        with pytest.raises(InvalidArgument, match=r"no object 'pos' .*\(available: post\)"):
            change("pos")
    with pytest.raises(InvalidArgument, match="post is not attached"):
        arm.scene.detach("post")
    for number in range(MAX_OBJECTS - 1):
        arm.scene.add(item(f"ball{number}", "sphere", (0.1,), 3.0))
    with pytest.raises(InvalidArgument, match=f"the scene has {MAX_OBJECTS} objects already"):
        arm.scene.add(item("more", "sphere", (0.1,), 3.0))


def test_a_carried_object_may_touch_the_links_that_it_names(arm: Arm) -> None:
    rod = item("rod", "box", (0.1, 0.1, 0.1), attached=True)
    names = set(arm.distances([rod]).names)
    touching = replace(rod, touch_links=frozenset({"link2"}))
    assert names - set(arm.distances([touching]).names) == {("link2", "rod")}


def test_objects_of_the_planning_scene_are_exchanged_together(arm: Arm) -> None:
    ball = replace(item("ball", "sphere", (0.1,), 3.0), in_planning_scene=True)
    arm.scene.add(item("own", "sphere", (0.1,), 2.0))
    arm.scene.exchange_planned([ball, replace(ball, name="other")])
    assert [one.name for one in arm.scene.objects] == ["own", "ball", "other"]
    for change in (arm.scene.remove, arm.scene.attach):
        with pytest.raises(InvalidArgument, match="ball belongs to MoveIt's planning scene"):
            change("ball")
    with pytest.raises(InvalidArgument, match="ball belongs to MoveIt's planning scene"):
        arm.scene.add(item("ball", "sphere", (0.1,), 3.0))
    for wrong in ("own", "link3"):
        with pytest.raises(InvalidArgument, match=wrong):
            arm.scene.exchange_planned([replace(ball, name="new"), replace(ball, name=wrong)])
    assert [one.name for one in arm.scene.objects] == ["own", "ball", "other"]
    arm.scene.exchange_planned([])
    assert [one.name for one in arm.scene.objects] == ["own"]


def test_objects_of_the_file_count_and_stay(tmp_path: Path) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text(
        "extends: cr3a\nname: arm\ntool_space:\n  collisions:\n"
        "    planes: {floor: {normal: [0, 0, 2], distance_m: -0.1}}\n"
        "    boxes: {machine: {xyz_m: [-0.75, 0, 0.4], size_m: [0.4, 1, 0.8]}}\n"
        "    cylinders: {post: {xyz_m: [0.3, 0.3, 0.5], radius_m: 0.1, length_m: 1.0}}\n"
        "    spheres: {ball: {xyz_m: [0.3, -0.3, 0.5], radius_m: 0.1}}\n",
        encoding="utf-8",
    )
    with open_robot(path, "sim", clock=SteppedClock()) as robot:
        arm = Arm(robot)
        assert [(one.name, one.shape) for one in arm.scene.objects] == [
            ("floor", "plane"),
            ("machine", "box"),
            ("post", "cylinder"),
            ("ball", "sphere"),
        ]
        assert all(one.in_file for one in arm.scene.objects)
        assert arm.scene.objects[0].pose[2] == pytest.approx([0.0, 0.0, 1.0, -0.1])
        for name in ("floor", "ball"):
            with pytest.raises(InvalidArgument, match=f"{name} belongs to the robot's file"):
                arm.scene.remove(name)
            with pytest.raises(InvalidArgument, match=f"{name} belongs to the robot's file"):
                arm.scene.add(item(name, "sphere", (0.1,)))
        go(arm.tool, BENT)
        met = set()
        for angle in np.linspace(-3.0, 3.0, 13):
            try:
                arm.follower.check(arm.request(turned(float(angle)) * [1, 1, 1, 1, 1, 0], 20.0))
            except TrajectoryRejected as error:
                met |= {name for name in ("post", "ball", "machine") if f"and {name}" in str(error)}
        assert met
    twice = path.read_text(encoding="utf-8").replace("ball:", "post:")
    path.write_text(twice, encoding="utf-8")
    with pytest.raises(DescriptorError, match=r"spheres\.post: is the name of another body, too"):
        load_robot_descriptor(path)


KINDS = {"box": "BOX", "cylinder": "CYLINDER", "sphere": "SPHERE"}


class MujocoScene:
    """The same arm and objects in MuJoCo, which reads the URDF by itself."""

    def __init__(self, urdf: Path, names: Sequence[str], objects: Sequence[SceneObject]) -> None:
        spec = mujoco.MjSpec.from_file(str(urdf))
        for one in objects:
            half = np.ones(3) if one.shape == "sphere" else np.array([0.5, 0.5, 0.5])
            if one.shape == "cylinder":
                half[0] = 1.0
            count, turn = len(one.size_m), np.zeros(4)
            mujoco.mju_mat2Quat(turn, one.pose[:3, :3].ravel())
            parent = spec.body("link6") if one.attached else spec.worldbody
            parent.add_geom(
                name=one.name,
                type=getattr(mujoco.mjtGeom, f"mjGEOM_{KINDS[one.shape]}"),
                size=[*(half[:count] * one.size_m), *[0.0] * (3 - count)],
                pos=one.pose[:3, 3],
                quat=turn,
            )
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        self._columns = [int(self._model.joint(name).qposadr[0]) for name in names]
        self._objects = {int(self._model.geom(one.name).id): one for one in objects}

    def touches(self, positions: FloatArray) -> bool:
        """An object around the arm touches a link, or one that the tool carries."""
        self._data.qpos[:] = 0.0
        self._data.qpos[self._columns] = positions
        mujoco.mj_forward(self._model, self._data)
        return any(self._counts(*map(int, contact.geom)) for contact in self._data.contact)

    def _counts(self, first: int, second: int) -> bool:
        stands = [
            geom in self._objects and not self._objects[geom].attached for geom in (first, second)
        ]
        moves = [self._model.geom_bodyid[geom] != 0 for geom in (first, second)]
        return (stands[0] and moves[1]) or (stands[1] and moves[0])


@pytest.mark.parametrize("shape", KINDS)
@pytest.mark.parametrize("attached", [False, True], ids=["around", "carried"])
def test_objects_touch_where_mujoco_finds_contacts(shape: str, attached: bool) -> None:
    descriptor = load_robot_descriptor("cr3a")
    assert descriptor.urdf is not None
    kinematics = Kinematics.of_descriptor(descriptor, "joints")
    random = np.random.default_rng(6)
    size = {"box": (0.3, 0.2, 0.2), "cylinder": (0.12, 0.4), "sphere": (0.15,)}[shape]
    turn = random.uniform(-1.0, 1.0, 3).tolist()
    place = [0.0, 0.0, 0.2] if attached else [0.35, -0.1, 0.4]
    objects = [SceneObject("thing", shape, size, pose_of(place, turn), attached=attached)]
    if attached:
        table = pose_of([0.4, 0.0, 0.2])
        objects.append(SceneObject("table", "box", (0.6, 0.6, 0.1), table))
    alone = Collisions.of(descriptor, kinematics, CollisionSettings(margin_m=0.0, links=False))
    theirs = MujocoScene(descriptor.urdf, kinematics.chain.names, objects)
    lower, upper = np.maximum(kinematics.lower, -np.pi), np.minimum(kinematics.upper, np.pi)
    positions = random.uniform(lower, upper, (200, len(lower)))
    free = (alone.with_objects(objects).distances(positions) > 0.0).all(axis=1)
    touching = np.array([theirs.touches(row) for row in positions])
    assert not (free & touching).any()
    assert touching.sum() > 10
    assert np.mean(free | touching) > 0.95, "nearly all others are free"
