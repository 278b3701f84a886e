"""The environment of a carried object: success, reward, and the same episode twice."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from tests.plugins.mujoco.cell import CARRIED_M, CUBE_M, LEFT, LEFT_ABOVE, RIGHT, RIGHT_ABOVE

from robotd.errors import InvalidArgument
from robotd_gym import PickAndPlace

# Targets of the joints, whether the gripper is closed, and for how many steps.
PLAN = (
    (LEFT_ABOVE, False, 35), (LEFT, False, 20), (LEFT, True, 15), (LEFT_ABOVE, True, 20),
    (RIGHT_ABOVE, True, 30), (RIGHT, True, 20), (RIGHT, False, 15),
)  # fmt: skip
OPTIONS = {"object": CUBE_M[:2], "goal": CARRIED_M[:2]}


def episode(env: PickAndPlace) -> tuple[list[float], bool, dict[str, Any]]:
    """Carry the object by the plan; return rewards, success and the last observation."""
    observation, _ = env.reset(seed=1, options=OPTIONS)
    rewards, success = [], False
    for target, closed, steps in PLAN:
        for _ in range(steps):
            step = env.stepped.velocity_limits * 0.8 * env.stepped.period_s
            action = np.append((np.array(target) - observation["command"]) / step, float(closed))
            action[-1] = 1.0 if closed else -1.0
            observation, reward, success, _, info = env.step(np.clip(action, -1.0, 1.0))
            assert info["is_success"] == success
            rewards.append(reward)
            if success:
                break
    return rewards, success, observation


def test_a_carried_object_is_a_success_and_the_episode_repeats() -> None:
    env = PickAndPlace()
    try:
        rewards, success, last = episode(env)
        assert success
        assert last["object"][:2] == pytest.approx(CARRIED_M[:2], abs=0.02)
        assert rewards[-1] > rewards[0]
        assert env.observation_space.contains(last)
        again, _, _ = episode(env)
        assert again == rewards
    finally:
        env.close()


def test_an_object_that_was_pushed_to_the_goal_is_no_success() -> None:
    env = PickAndPlace()
    try:
        observation, _ = env.reset(seed=1, options={"object": CUBE_M[:2], "goal": CUBE_M[:2]})
        assert observation["object_velocity"] == pytest.approx(np.zeros(3))
        action = np.append(np.zeros(6), -1.0)
        for _ in range(5):
            observation, _, success, _, _ = env.step(action)
        assert np.linalg.norm(observation["object"][:2] - observation["goal"]) < 0.02
        assert not success, "it was never lifted"
    finally:
        env.close()


def test_gymnasium_finds_no_fault_in_it_as_it_is_made() -> None:
    env: Any = gymnasium.make("robotd_gym:robotd/PickAndPlace-v0")
    try:
        check_env(env.unwrapped)  # its warnings are errors here
    finally:
        env.close()


def test_random_places_are_apart_and_seeded() -> None:
    env: Any = gymnasium.make("robotd_gym:robotd/PickAndPlace-v0")
    try:
        first, _ = env.reset(seed=5)
        assert np.linalg.norm(first["object"][:2] - first["goal"]) >= 0.1
        second, _ = env.reset(seed=5)
        assert second["goal"].tolist() == first["goal"].tolist()
    finally:
        env.close()


def test_a_backend_without_a_world_is_rejected() -> None:
    env = PickAndPlace(backend="sim")
    try:
        with pytest.raises(InvalidArgument, match="the backend sim has no world"):
            env.reset()
    finally:
        env.close()
