"""Environments of robotd_gym beside a bare loop of MuJoCo, in steps per second of processor time.

``python -m tools.bench.gym_steps`` prints medians of ``ROUNDS`` rounds in which the three take
turns, ``STEPS`` steps each, with random actions and without ``reset``. The bare loop steps the
model that the backend compiles for cr3a, drives on, through the same simulated time per step. Once
per step it sets the position commands of the drives, a random walk like that of the environments.
"""

from __future__ import annotations

import gc
import operator
import statistics
import time
from typing import Any

import gymnasium
import mujoco
import numpy as np

from robotd_gym import JOINT_REACH, PICK_AND_PLACE, SteppedRobot
from robotd_gym.joint_reach import SPEED
from robotd_mujoco.physics import Physics

ROUNDS, STEPS = 25, 20
WARM_UP = 5  # steps of a round that are not counted: caches are another one's


class BareLoop:
    """MuJoCo alone, with the model and the first state of a robot."""

    def __init__(self) -> None:
        robot = SteppedRobot("cr3a", backend="mujoco")
        robot.reset(seed=0)
        (physics,) = (item for item in gc.get_objects() if isinstance(item, Physics))
        self._model, self._data = physics.model, mujoco.MjData(physics.model)
        self._data.qpos[:], self._data.ctrl[:] = physics.data.qpos, physics.data.ctrl
        self._data.eq_active[:] = physics.data.eq_active
        self._motors = [drive.position for drive in physics.drives]
        self._change = SPEED * robot.velocity_limits * robot.period_s
        self._range = robot.lower, robot.upper
        self.substeps = round(robot.period_s / self._model.opt.timestep)
        self._robot = robot  # its drives stay on, in the shared model

    def step(self, action: Any) -> None:
        """Advance by the time of one step of an environment."""
        command = self._data.ctrl[self._motors] + action * self._change
        self._data.ctrl[self._motors] = np.clip(command, *self._range)
        for _ in range(self.substeps):
            mujoco.mj_step(self._model, self._data)


class Environment:
    """An environment that begins anew when an episode has ended, outside of the measured time."""

    def __init__(self, name: str) -> None:
        self._environment: Any = gymnasium.make(f"robotd_gym:{name}").unwrapped
        self._environment.reset(seed=0)
        self.actions = self._environment.action_space.sample().size

    def restart(self) -> None:
        """Begin a new episode."""
        self._environment.reset()

    def step(self, action: Any) -> None:
        """Take one step."""
        self._environment.step(action)


def main() -> None:
    """Measure and print."""
    bare = BareLoop()
    environments = {name: Environment(name) for name in (JOINT_REACH, PICK_AND_PLACE)}
    random = np.random.default_rng(0)
    rates: dict[str, list[float]] = {"bare": [], JOINT_REACH: [], PICK_AND_PLACE: []}
    for _ in range(ROUNDS):
        rates["bare"].append(_measure(bare, 6, random))
        for name, environment in environments.items():
            environment.restart()
            rates[name].append(_measure(environment, environment.actions, random))
    print(f"{bare.substeps} physics steps per step, steps per second of processor time:")
    for name, found in rates.items():
        share = statistics.median(map(operator.truediv, found, rates["bare"]))
        rate = statistics.median(found)
        print(f"{name:24} {rate:6.0f} ({min(found):.0f} to {max(found):.0f})  {share:.2f} of bare")


def _measure(subject: BareLoop | Environment, actions: int, random: np.random.Generator) -> float:
    """Return the steps per second of processor time."""
    drawn = random.uniform(-1.0, 1.0, (WARM_UP + STEPS, actions))
    for action in drawn[:WARM_UP]:
        subject.step(action)
    start_s = time.process_time()
    for action in drawn[WARM_UP:]:
        subject.step(action)
    return STEPS / (time.process_time() - start_s)


if __name__ == "__main__":
    main()
