"""Record an episode of a robot as a LeRobot dataset; ``lerobot-replay`` plays it back.

    python examples/robot_learning/lerobot_dataset.py --root build/wave
    lerobot-replay --robot.type=robotd --robot.descriptor=cr3a \
        --dataset.repo_id=local/wave --dataset.root=build/wave --dataset.episode=0 \
        --play_sounds=false

Needs ``lerobot_robot_robotd`` and ``lerobot[core_scripts]``. With a teleoperator,
``lerobot-record`` does this without a program.
"""

from __future__ import annotations

import time
from pathlib import Path

import click
import numpy as np
from lerobot.datasets import LeRobotDataset
from lerobot.utils.constants import ACTION, OBS_STR
from lerobot.utils.feature_utils import build_dataset_frame, hw_to_dataset_features

from lerobot_robot_robotd import RobotdRobot, RobotdRobotConfig

RATE_HZ = 30
SECONDS = 5.0
AMPLITUDE_RAD = 0.2


@click.command()
@click.option("--descriptor", default="cr3a", show_default=True, help="Robot of robotd.")
@click.option("--backend", help="Default: the robot's own.")
@click.option("--root", type=click.Path(path_type=Path), required=True, help="A new folder.")
def main(descriptor: str, backend: str | None, root: Path) -> None:
    """Wave with the first joint, and record it."""
    robot = RobotdRobot(RobotdRobotConfig(descriptor=descriptor, backend=backend))
    features = hw_to_dataset_features(robot.action_features, ACTION)
    features |= hw_to_dataset_features(robot.observation_features, OBS_STR)
    dataset = LeRobotDataset.create(
        "local/wave", RATE_HZ, features, root=root, robot_type=robot.name
    )
    with robot:
        observation = robot.get_observation()
        action = {name: observation[name] for name in robot.action_features}
        joint = next(iter(action))
        centre, began_s = action[joint], time.perf_counter()
        for index in range(round(SECONDS * RATE_HZ)):
            wave = np.sin(2.0 * np.pi * index / (SECONDS * RATE_HZ))
            sent = robot.send_action(action | {joint: centre + AMPLITUDE_RAD * wave})
            frame = build_dataset_frame(dataset.features, robot.get_observation(), OBS_STR)
            frame |= build_dataset_frame(dataset.features, sent, ACTION)
            dataset.add_frame(frame | {"task": "wave"})
            time.sleep(max(0.0, began_s + (index + 1) / RATE_HZ - time.perf_counter()))
    dataset.save_episode()
    dataset.finalize()
    click.echo(f"{dataset.num_frames} frames in {root}")


if __name__ == "__main__":
    main()
