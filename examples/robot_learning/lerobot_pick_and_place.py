"""Record a carried cube with LeRobot's own record, and carry it again with its own replay.

    python examples/robot_learning/lerobot_pick_and_place.py record build/carry
    python examples/robot_learning/lerobot_pick_and_place.py replay build/carry

The robot is ``cr3a`` on the backend ``mujoco``, the policy a plan of poses, offered to LeRobot as
a teleoperator. Both commands print where the cube has been left. Needs ``lerobot_robot_robotd``,
``lerobot[core_scripts]`` and ``robotd[mujoco]``.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
from lerobot.configs.dataset import DatasetRecordConfig
from lerobot.robots import RobotConfig
from lerobot.scripts.lerobot_record import RecordConfig, record
from lerobot.scripts.lerobot_replay import DatasetReplayConfig, ReplayConfig, replay
from lerobot.teleoperators import Teleoperator, TeleoperatorConfig

from lerobot_robot_robotd import RobotdRobot, RobotdRobotConfig, WorldCameraConfig
from robotd.api import load_robot_descriptor

REPO, RATE_HZ = "local/carry", 10
DESCRIPTOR, OBJECT = "cr3a", "cube"
CLOSED_M, OPEN_M = 0.045, 0.0
PARK = (0.0,) * 6
LEFT = (0.6, -0.11370677, -1.8616441, 0.40456556, 1.57079633, 2.17079633)
LEFT_ABOVE = (0.6, -0.04622459, -1.48981195, -0.03474877, 1.57079633, 2.17079633)
RIGHT, RIGHT_ABOVE = (-0.6, *LEFT[1:]), (-0.6, *LEFT_ABOVE[1:])
# Pose, gripper, and seconds to get there.
PLAN = (
    (LEFT_ABOVE, OPEN_M, 2.5),
    (LEFT, OPEN_M, 1.5),
    (LEFT, CLOSED_M, 1.0),
    (LEFT_ABOVE, CLOSED_M, 1.5),
    (RIGHT_ABOVE, CLOSED_M, 2.0),
    (RIGHT, CLOSED_M, 1.5),
    (RIGHT, OPEN_M, 1.0),
    (RIGHT_ABOVE, OPEN_M, 1.5),
)
PLAN_S = sum(seconds for *_, seconds in PLAN)
MARGIN = 1.3  # of the time, for a computer that is busy: the last pose is held


@RobotConfig.register_subclass("robotd_carrier")
@dataclass(kw_only=True)
class CarrierConfig(RobotdRobotConfig):
    """Options of ``Carrier``; LeRobot finds a robot by the name of its options."""


class Carrier(RobotdRobot):
    """Robot that prints where the cube is before it disconnects."""

    config_class = CarrierConfig
    name = "robotd_carrier"

    def disconnect(self) -> None:
        world = self._connected().world
        if world is not None:
            names = [item.name for item in world.objects]
            x, y, z = world.poses()[names.index(OBJECT), :3]
            click.echo(f"{OBJECT} left at x={x:.4f} y={y:.4f} z={z:.4f}")
        super().disconnect()


@TeleoperatorConfig.register_subclass("robotd_plan")
@dataclass(kw_only=True)
class PlannedMotionConfig(TeleoperatorConfig):
    """Options of ``PlannedMotion``; there are none."""


class PlannedMotion(Teleoperator):
    """The plan, one action for each call: an episode does not depend on the computer's load."""

    config_class = PlannedMotionConfig
    name = "robotd_plan"

    def __init__(self, config: PlannedMotionConfig) -> None:
        super().__init__(config)
        self._names = [joint.name for joint in load_robot_descriptor(DESCRIPTOR).joints]
        self._actions, self._connected = 0, False

    @property
    def action_features(self) -> dict[str, Any]:
        return {f"{name}.pos": float for name in [*self._names, "gripper"]}

    @property
    def feedback_features(self) -> dict[str, Any]:
        return {}

    def get_action(self) -> dict[str, Any]:
        passed_s = self._actions / RATE_HZ
        self._actions += 1
        step = 0
        while passed_s >= PLAN[step][2] and step + 1 < len(PLAN):
            passed_s, step = passed_s - PLAN[step][2], step + 1
        before = PLAN[step - 1][0] if step else PARK
        pose, gripper, seconds = PLAN[step]
        part = min(1.0, passed_s / seconds)
        share = part * part * (3.0 - 2.0 * part)
        joints = [start + share * (end - start) for start, end in zip(before, pose, strict=True)]
        return dict(zip(self.action_features, [*joints, gripper], strict=True))

    def connect(self, calibrate: bool = True) -> None:
        self._connected = True

    def disconnect(self) -> None:
        self._connected = False

    @property
    def is_connected(self) -> bool:
        return self._connected

    @property
    def is_calibrated(self) -> bool:
        return True

    def calibrate(self) -> None:
        pass

    def configure(self) -> None:
        pass

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        pass


@click.group()
def main() -> None:
    """Record or replay one episode."""


@main.command("record")
@click.argument("root", type=click.Path(path_type=Path))
def record_episode(root: Path) -> None:
    """Carry the cube once, into a new dataset in the folder ROOT."""
    camera = WorldCameraConfig(camera="cell_camera", width=320, height=240, fps=RATE_HZ)
    dataset = DatasetRecordConfig(
        repo_id=REPO, root=root, single_task="Carry the cube to the right", fps=RATE_HZ,
        episode_time_s=MARGIN * PLAN_S, num_episodes=1, push_to_hub=False,
    )  # fmt: skip
    robot = CarrierConfig(descriptor=DESCRIPTOR, backend="mujoco", cameras={"cell": camera})
    made = record(
        RecordConfig(robot=robot, dataset=dataset, teleop=PlannedMotionConfig(), play_sounds=False)
    )
    click.echo(f"{made.num_frames} frames of {made.num_episodes} episode in {root}")


@main.command("replay")
@click.argument("root", type=click.Path(path_type=Path, exists=True))
def replay_episode(root: Path) -> None:
    """Send the recorded actions to a new robot."""
    dataset = DatasetReplayConfig(repo_id=REPO, episode=0, root=root)
    robot = CarrierConfig(descriptor=DESCRIPTOR, backend="mujoco")
    replay(ReplayConfig(robot=robot, dataset=dataset, play_sounds=False))


if __name__ == "__main__":
    main()
