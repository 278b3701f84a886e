"""Record an episode of the gymnasium environment, and play it back on any robot.

    python examples/robot_learning/episode.py record episode.npz --seed 3
    python examples/robot_learning/episode.py play episode.npz               # the simulation
    python examples/robot_learning/episode.py play episode.npz --backend wmx # the robot

Recording takes simulated time: an episode of two seconds is recorded in a fraction of one. Playing
takes real time. The policy here moves each joint towards its goal; put a learned one in its place.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import gymnasium
import numpy as np

from robotd import open_robot
from robotd.api import NANOSECONDS, Clock, MonotonicClock
from robotd.api.robots import TrajectoryRequest
from robotd_gym import JOINT_REACH, SteppedRobot

GAIN = 4.0  # 1/s, of the policy
APPROACH_RAD_S = 0.3  # mean speed to the first position of an episode

Episode = dict[str, Any]


def policy(observation: dict[str, np.ndarray], robot: SteppedRobot) -> np.ndarray:
    """Return an action that moves towards the goal."""
    speed = GAIN * (observation["goal"] - observation["command"])
    return np.clip(speed / robot.velocity_limits, -1.0, 1.0)


def record(robot: str, seed: int) -> Episode:
    """Run one episode; return the commanded and the measured positions, one row per step."""
    environment = gymnasium.make(f"robotd_gym:{JOINT_REACH}", robot=robot)
    try:
        observation, _ = environment.reset(seed=seed)
        stepped = environment.unwrapped.stepped
        rows, ended, info = [observation], False, {}
        while not ended:
            action = policy(observation, stepped)
            observation, _, terminated, truncated, info = environment.step(action)
            rows.append(observation)
            ended = terminated or truncated
        return {
            "robot": robot,
            "joints": np.array(stepped.joint_names),
            "period_s": stepped.period_s,
            "command": np.array([row["command"] for row in rows]),
            "position": np.array([row["position"] for row in rows]),
            "is_success": info["is_success"],
        }
    finally:
        environment.close()


def play(episode: Episode, backend: str | None = None, clock: Clock | None = None) -> np.ndarray:
    """Move to the first position, then stream the commands; return the measured positions."""
    clock = clock or MonotonicClock()
    joints, commands = episode["joints"].tolist(), episode["command"]
    with open_robot(str(episode["robot"]), backend, clock=clock) as robot:
        axes = list(robot.joint_axes)
        distance = np.abs(robot.image.copy().position[axes] - commands[0]).max()
        if distance > 1e-3:
            time_s = [max(1.0, distance / APPROACH_RAD_S)]
            request = TrajectoryRequest.from_rows(joints, time_s, [commands[0].tolist()])
            with robot.follower.follow(request) as execution:
                while not execution.done:
                    clock.sleep_until_ns(clock.now_ns() + NANOSECONDS // 100)
                click.echo(execution.message)
        positions = [robot.image.copy().position[axes]]
        with robot.stream(joints, mode="smooth", timeout_s=0.4, owner="episode") as stream:
            due_ns = clock.now_ns()
            for command in commands[1:]:
                stream.send(command.tolist())
                due_ns += round(float(episode["period_s"]) * NANOSECONDS)
                clock.sleep_until_ns(due_ns)
                positions.append(robot.image.copy().position[axes])
    return np.array(positions)


@click.group()
def main() -> None:
    """Record and play back episodes."""


@main.command("record")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--robot", default="cr3a", show_default=True)
@click.option("--seed", default=0, show_default=True)
def record_command(file: Path, robot: str, seed: int) -> None:
    """Record an episode into FILE (.npz)."""
    episode = record(robot, seed)
    np.savez(file, **episode)
    steps = len(episode["command"]) - 1
    result = "goal reached" if episode["is_success"] else "goal not reached"
    click.echo(f"{result} after {steps} steps, {steps * episode['period_s']:.2f} s")


@main.command("play")
@click.argument("file", type=click.Path(exists=True, path_type=Path))
@click.option("--backend", help="Default: the robot's own.")
def play_command(file: Path, backend: str | None) -> None:
    """Play FILE on a robot, in real time, and compare the positions."""
    with np.load(file) as stored:
        episode: Episode = dict(stored)
    difference = np.abs(play(episode, backend) - episode["position"]).max()
    click.echo(f"largest difference to the recorded positions: {difference:.4f} rad or m")


if __name__ == "__main__":
    main()
