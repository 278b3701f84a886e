"""The gymnasium environment: interface, determinism, limits, and the example of an episode."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from robotd.clock.simulated import SteppedClock
from robotd.errors import InvalidArgument, NotReady
from robotd_gym import JOINT_REACH, PICK_AND_PLACE, JointReach, SteppedRobot
from robotd_gym.joint_reach import BLUE, GREEN, ROW, WIDTH

EXAMPLE = Path(__file__).parents[3] / "examples" / "robot_learning" / "episode.py"


def rollout(environment: JointReach, seed: int, steps: int = 20) -> list[Any]:
    """Run random actions; return all that the environment returned."""
    observation, info = environment.reset(seed=seed)
    environment.action_space.seed(seed)
    found: list[Any] = [(observation, info)]
    for _ in range(steps):
        found.append(environment.step(environment.action_space.sample()))
        assert environment.observation_space.contains(found[-1][0])
    return found


def test_it_has_the_interface_of_gymnasium() -> None:
    environment = gymnasium.make(f"robotd_gym:{JOINT_REACH}")
    assert environment.spec is not None
    assert environment.spec.max_episode_steps == 250
    check_env(environment.unwrapped)  # its warnings are errors here
    environment.close()


def test_an_episode_depends_on_seed_and_actions_only() -> None:
    first, second = JointReach(), JointReach()
    try:
        rollout(second, seed=8, steps=5)  # an episode before
        a, b = rollout(first, seed=4), rollout(second, seed=4)
        other = rollout(first, seed=5)
    finally:
        first.close()
        second.close()
    np.testing.assert_equal(a, b)  # exactly
    assert not np.array_equal(a[0][0]["goal"], other[0][0]["goal"])


@pytest.mark.parametrize("mode", ["sync", "async"])
@pytest.mark.parametrize("name", [JOINT_REACH, PICK_AND_PLACE])
def test_vector_environments_with_one_seed_are_alike(name: str, mode: str) -> None:
    environments = gymnasium.make_vec(f"robotd_gym:{name}", 3, vectorization_mode=mode)
    environments.reset(seed=[1, 1, 2])
    environments.action_space.seed(0)
    actions = environments.action_space.sample()
    actions[1:] = actions[0]
    observation, _, _, _, _ = environments.step(actions)
    environments.close()
    for values in observation.values():
        np.testing.assert_array_equal(values[0], values[1])
    assert not np.array_equal(observation["goal"][0], observation["goal"][2])


def test_the_simulated_noise_depends_on_the_seed(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text(
        "schema: 1\nname: noisy\nextends: cr3a\nbackends: {sim: {velocity_noise_rad_s: 0.01}}\n"
    )
    robot = SteppedRobot(file)

    def velocities(seed: int) -> list[float]:
        robot.reset(seed)
        robot.step(np.zeros(6))
        values: list[float] = robot.velocity.tolist()
        return values

    try:
        assert velocities(1) == velocities(1)
        assert velocities(1) != velocities(2)
    finally:
        robot.close()


def test_a_goal_is_reached_and_limits_hold() -> None:
    environment = JointReach()
    goal = np.array([0.5, -0.3, 0.2, 0.0, 9.0, -0.1])
    try:
        observation, _ = environment.reset(seed=1, options={"goal": goal})
        assert observation["goal"][4] == 3.14  # clipped to the limit
        limit, rewards = environment.stepped.velocity_limits, []
        for _ in range(100):
            away = observation["goal"] - observation["command"]
            observation, reward, terminated, _, info = environment.step(8.0 * away)
            rewards.append(reward)
            assert (np.abs(observation["velocity"]) <= limit).all()
            if terminated:
                break
        assert info["is_success"]
        assert rewards[0] < rewards[-1] < 0.0
        assert np.abs(observation["position"] - observation["goal"]).max() < 0.02
    finally:
        environment.close()


@pytest.mark.parametrize("robot", ["dual_cr3a", "mobile_manipulator"])
def test_other_robots_can_be_used(robot: str) -> None:
    environment = JointReach(robot)
    try:
        assert len(rollout(environment, seed=1, steps=5)) == 6
    finally:
        environment.close()


def test_a_continuous_joint_has_goals_within_a_turn(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text(
        "schema: 1\nname: table\nbackend: sim\ncycle: {rate_hz: 500}\njoints:\n"
        "  - {name: turn, axis: 0, type: continuous, velocity_rad_s: 2, acceleration_rad_s2: 8}\n"
    )
    environment = JointReach(file)
    try:
        observation, _ = environment.reset(seed=1)
        assert abs(observation["goal"][0]) < np.pi
        assert environment.observation_space["position"].high[0] == np.inf
    finally:
        environment.close()


def test_a_picture_shows_position_and_goal() -> None:
    environment = gymnasium.make(f"robotd_gym:{JOINT_REACH}", render_mode="rgb_array")
    environment.reset(seed=1, options={"goal": [3.0, 0.0, 0.0, 0.0, 0.0, 0.0]})
    picture = environment.render()
    environment.close()
    assert isinstance(picture, np.ndarray)
    row = picture[ROW // 2]  # of joint1
    goal = np.flatnonzero((row == GREEN).all(1)).mean() / WIDTH
    position = np.flatnonzero((row == BLUE).all(1)).mean() / WIDTH
    assert position == pytest.approx(0.5, abs=0.02)
    assert goal == pytest.approx((3.0 / np.pi + 1.0) / 2.0, abs=0.03)


@pytest.mark.parametrize("action", [[0.0] * 5, [np.inf] + [0.0] * 5, [np.nan] * 6])
def test_a_wrong_action_is_rejected_and_moves_nothing(action: list[float]) -> None:
    environment = JointReach()
    observation, _ = environment.reset(seed=1)
    with pytest.raises(InvalidArgument, match="must be 6 finite numbers"):
        environment.step(np.array(action))
    assert np.array_equal(environment.stepped.position, observation["position"])
    environment.close()


def test_a_wrong_target_for_one_arm_moves_no_arm() -> None:
    stepped = SteppedRobot("dual_cr3a")
    stepped.reset()
    rest = stepped.position
    target = rest + 0.3
    target[-1] = np.nan
    with pytest.raises(InvalidArgument, match="must be finite numbers"):
        stepped.step(target)
    stepped.robot.step(200)
    assert stepped.position == pytest.approx(rest, abs=1e-6)
    stepped.close()


def test_wrong_arguments_are_rejected() -> None:
    with pytest.raises(InvalidArgument, match="500 Hz must be a multiple"):
        SteppedRobot(rate_hz=30.0)
    with pytest.raises(InvalidArgument, match="mecanum_base has no joints"):
        SteppedRobot("mecanum_base")
    with pytest.raises(InvalidArgument, match=r"render_mode is 'human'"):
        JointReach(render_mode="human")
    for tolerance in (0.0, -1.0, np.nan):
        with pytest.raises(InvalidArgument, match=r"tolerance is .*, must be above 0"):
            JointReach(tolerance=tolerance)
    for goal in ([0.0] * 5, [np.nan] * 6):
        with pytest.raises(InvalidArgument, match=r"goal is .*, must be 6 finite numbers"):
            JointReach().reset(options={"goal": goal})
    with pytest.raises(NotReady, match="has not been reset"):
        SteppedRobot().step(np.zeros(6))


def test_a_recorded_episode_is_played_back_exactly() -> None:
    example = _load(EXAMPLE)
    episode = example.record("cr3a", seed=3)
    assert episode["is_success"]
    played = example.play(episode, clock=SteppedClock())
    assert np.array_equal(played, episode["position"])


def _load(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
