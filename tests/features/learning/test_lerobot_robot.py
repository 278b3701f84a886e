"""``lerobot_robot_robotd`` with a simulated robot, on a stand-in for LeRobot."""

from __future__ import annotations

import signal
import sys
import tomllib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.features.learning import lerobot_stand_in as stand_in

import robotd
from robotd.clock.simulated import SteppedClock
from robotd.errors import InvalidArgument, NotReady

DISTRIBUTION = Path(__file__).parents[3] / "features" / "learning" / "lerobot_robot_robotd"

Make = Callable[..., Any]


@pytest.fixture
def make(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Make]:
    """``make(**options)``: a robot as LeRobot makes it from its type, in simulated time."""
    stand_in.install(monkeypatch)
    monkeypatch.syspath_prepend(str(DISTRIBUTION))
    name = tomllib.loads((DISTRIBUTION / "pyproject.toml").read_text())["project"]["name"]
    assert name.startswith("lerobot_robot_")  # the distributions that LeRobot imports
    __import__(name)
    module = sys.modules["lerobot_robot_robotd.robotd_robot"]
    made: list[Any] = []

    def with_options(**options: Any) -> Any:
        monkeypatch.setattr(module, "open_robot", partial(robotd.open_robot, clock=SteppedClock()))
        config = stand_in.RobotConfig.types["robotd"](calibration_dir=tmp_path, **options)
        made.append(stand_in.make_robot_from_config(config))
        return made[-1]

    yield with_options
    for robot in made:
        if robot.is_connected:
            robot.disconnect()


def let_pass(robot: Any, seconds: float) -> None:
    robot._robot.step(round(seconds * robot._robot.descriptor.cycle.rate_hz))


def drive(robot: Any, action: dict[str, float], seconds: float) -> dict[str, Any]:
    """Send ``action`` 25 times a second; return the last observation."""
    for _ in range(round(seconds * 25.0)):
        robot.send_action(action)
        let_pass(robot, 0.04)
    observation: dict[str, Any] = robot.get_observation()
    return observation


def test_actions_move_the_joints_and_the_gripper(make: Make) -> None:
    robot = make()
    joints = [f"joint{index}.pos" for index in range(1, 7)]
    assert robot.action_features == dict.fromkeys([*joints, "gripper.pos"], float)
    assert robot.observation_features == robot.action_features
    assert robot.is_calibrated
    assert not robot.is_connected
    with robot:
        assert robot.is_connected
        rest = robot.get_observation()
        let_pass(robot, 0.5)
        assert robot.get_observation() == rest  # nothing moves without an action
        goal = dict.fromkeys(joints, 0.3) | {"gripper.pos": 0.04}
        observation = drive(robot, goal, 1.2)
        assert [observation[joint] for joint in joints] == pytest.approx([0.3] * 6, abs=1e-3)
        assert observation["gripper.pos"] == pytest.approx(0.045)  # the nearer end
        assert drive(robot, goal | {"gripper.pos": 0.0}, 0.6)["gripper.pos"] == 0.0
    assert not robot.is_connected


def test_positions_beyond_a_limit_are_clipped_and_returned(make: Make) -> None:
    robot = make()
    with robot:
        rest = robot.get_observation()
        sent = robot.send_action(rest | {"joint3.pos": 9.0})
        assert sent == rest | {"joint3.pos": 2.86}


def test_targets_are_not_farther_away_than_the_greatest_distance(make: Make) -> None:
    robot = make(max_relative_target=0.05)
    with robot:
        rest = robot.get_observation()
        sent = robot.send_action(
            rest | {"joint3.pos": -1.0, "joint1.pos": rest["joint1.pos"] + 0.01}
        )
        assert sent["joint3.pos"] == pytest.approx(rest["joint3.pos"] - 0.05)
        assert sent["joint1.pos"] == pytest.approx(rest["joint1.pos"] + 0.01)
    with pytest.raises(InvalidArgument, match=r"max_relative_target 0\.0 of joint1: must be above"):
        make(max_relative_target=0.0)


def test_the_greatest_distance_of_one_joint_leaves_the_others(make: Make) -> None:
    with make(max_relative_target={"joint3": 0.05}) as robot:
        rest = robot.get_observation()
        moved = {"joint3.pos": -1.0, "joint1.pos": rest["joint1.pos"] + 0.1}
        sent = robot.send_action(rest | moved)
        assert sent["joint3.pos"] == pytest.approx(rest["joint3.pos"] - 0.05)
        assert sent["joint1.pos"] == pytest.approx(rest["joint1.pos"] + 0.1)
    with pytest.raises(InvalidArgument, match=r"no joint 'elbow' \(available: joint1, "):
        make(max_relative_target={"elbow": 0.1})


def test_datasets_name_the_robot(make: Make) -> None:
    assert make(descriptor="cr5a").robot_type == "cr5a"


def test_sigterm_ends_the_program_through_its_disconnect(make: Make) -> None:
    robot = make()
    with pytest.raises(KeyboardInterrupt), robot:
        signal.raise_signal(signal.SIGTERM)
    assert not robot.is_connected
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"joint9.pos": 0.0}, "missing or unknown: joint9.pos"),
        ({"joint1.pos": float("nan")}, "joint1.pos is nan"),
        ({"gripper.pos": float("nan")}, "gripper.pos is nan"),
    ],
)
def test_wrong_actions_are_rejected_and_move_nothing(
    make: Make, change: dict[str, float], expected: str
) -> None:
    with make() as robot:
        rest = drive(robot, robot.get_observation() | {"gripper.pos": 0.0}, 0.6)
        moving = rest | {"joint2.pos": rest["joint2.pos"] + 0.3}
        with pytest.raises(InvalidArgument, match=expected):
            robot.send_action(moving | change)
        let_pass(robot, 0.6)
        assert robot.get_observation() == pytest.approx(rest, abs=1e-6)


def test_an_action_with_a_wrong_value_for_one_arm_moves_no_arm(make: Make) -> None:
    with make(descriptor="dual_cr3a") as robot:
        rest = robot.get_observation()
        names = [name for name in rest if name != "gripper.pos"]
        with pytest.raises(InvalidArgument, match=f"{names[-1]} is nan"):
            robot.send_action(rest | {names[0]: rest[names[0]] + 0.3, names[-1]: float("nan")})
        let_pass(robot, 0.5)
        assert robot.get_observation() == pytest.approx(rest, abs=1e-6)


def test_a_missing_value_is_named(make: Make) -> None:
    with make() as robot, pytest.raises(InvalidArgument, match=r"missing or unknown: .*joint2.pos"):
        robot.send_action({"joint1.pos": 0.0})


def test_silence_ends_in_rest_and_the_next_action_continues(make: Make) -> None:
    robot = make(velocities=True, timeout_s=0.2)
    with robot:
        goal = robot.get_observation()
        goal = {name: goal[name] for name in robot.action_features} | {"joint1.pos": 3.0}
        assert drive(robot, goal, 0.3)["joint1.vel"] > 0.5
        let_pass(robot, 1.0)
        observation = robot.get_observation()
        assert set(observation) == set(robot.observation_features)
        assert observation["joint1.vel"] == pytest.approx(0.0, abs=1e-3)
        assert observation["joint1.pos"] < 2.5
        assert drive(robot, goal, 2.5)["joint1.pos"] == pytest.approx(3.0, abs=1e-3)


def test_a_stop_ends_actions_with_its_reason(make: Make) -> None:
    robot = make()
    with robot:
        observation = robot.get_observation()
        robot.send_action(observation)
        robot._robot.stop("the door is open")
        with pytest.raises(NotReady, match="the door is open"):
            robot.send_action(observation)


def test_it_is_used_between_connect_and_disconnect_only(make: Make) -> None:
    robot = make()
    for call in (robot.get_observation, robot.disconnect, lambda: robot.send_action({})):
        with pytest.raises(stand_in.DeviceNotConnectedError):
            call()
    robot.connect()
    with pytest.raises(stand_in.DeviceAlreadyConnectedError):
        robot.connect()
    robot.disconnect()
    with robot:  # again
        assert robot.is_connected


def test_both_arms_of_a_robot_with_joint_groups_move(make: Make) -> None:
    robot = make(descriptor="dual_cr3a")
    with robot:
        goal = robot.get_observation() | {"left_joint1.pos": 0.3, "right_joint2.pos": -0.2}
        observation = drive(robot, goal, 1.0)
    assert observation["left_joint1.pos"] == pytest.approx(0.3, abs=1e-3)
    assert observation["right_joint2.pos"] == pytest.approx(-0.2, abs=1e-3)


def test_images_are_observed(make: Make) -> None:
    robot = make(cameras={"wrist": stand_in.CameraConfig(width=8, height=6, fps=30)})
    assert robot.observation_features["wrist"] == (6, 8, 3)
    with robot:
        assert np.array_equal(robot.get_observation()["wrist"], np.full((6, 8, 3), 128))
    assert not robot.cameras["wrist"].is_connected


def test_a_robot_without_joints_is_rejected(make: Make) -> None:
    with pytest.raises(InvalidArgument, match="mecanum_base has no joints"):
        make(descriptor="mecanum_base")


def test_cameras_of_the_simulated_world(make: Make) -> None:
    world_camera = sys.modules["lerobot_robot_robotd"].WorldCameraConfig

    def camera(name: str = "cell_camera", width: int = 320) -> Any:
        return world_camera(camera=name, width=width, height=240, fps=10)

    robot = make(backend="mujoco", cameras={"cell": camera()})
    assert robot.observation_features["cell"] == (240, 320, 3)
    assert not robot.is_connected
    with robot:
        picture = robot.get_observation()["cell"]
        assert (picture.shape, picture.dtype) == ((240, 320, 3), np.uint8)
        assert picture.std() > 10.0, "it shows something"
    with pytest.raises(InvalidArgument, match="width and height must be 320 and 240"):
        make(backend="mujoco", cameras={"cell": camera(width=640)}).connect()
    with pytest.raises(InvalidArgument, match="unknown camera 'none'"):
        make(backend="mujoco", cameras={"cell": camera("none")}).connect()
    with pytest.raises(InvalidArgument, match="camera"):
        make(backend="sim", cameras={"cell": camera()}).connect()
