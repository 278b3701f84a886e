"""Joint groups on the engine: one device, one cyclic buffer each, goals at the same time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import yaml

from robotd.control.loop.setpoint_source import Outcome
from robotd.device.state import Operation
from robotd.errors import Unsupported
from robotd.motion import TrajectoryRequest
from robotd.robot import open_robot
from robots import JOINTS, descriptor, eventually

GROUPS = {"front": {"joints": list(JOINTS[:3])}, "back": {"joints": list(JOINTS[3:])}}


def grouped(folder: Path, **wmx: object) -> Path:
    """The arm as two groups of three joints."""
    path = descriptor(folder, **wmx)
    data = yaml.safe_load(path.read_text("utf-8"))
    arm = ("follow_joint_trajectory_server", "joint_command_node", "gripper_controller")
    data["nodes"] = [node for node in data["nodes"] if node not in arm]
    data["ros_parameters"] = {"manipulator_state": data["ros_parameters"]["manipulator_state"]}
    del data["variants"], data["default_variant"]
    path.write_text(yaml.safe_dump({**data, "groups": GROUPS}), "utf-8")
    return path


def to(names: Sequence[str], position: float, time_s: float) -> TrajectoryRequest:
    return TrajectoryRequest.from_rows(names, [time_s], [[position] * len(names)])


def test_goals_of_two_groups_run_at_the_same_time(tmp_path: Path) -> None:
    with open_robot(grouped(tmp_path), "wmx") as robot:
        front, back = robot.groups["front"], robot.groups["back"]
        with (
            front.follower.follow(to(front.joint_names, 0.4, 2.0)) as slow,
            back.follower.follow(to(back.joint_names, -0.2, 1.0)) as quick,
        ):
            eventually(lambda: bool((robot.image.operation == Operation.STREAM).all()))
            assert quick.wait(10.0)
            assert not slow.done, "the other group is on its way"
            assert slow.wait(10.0)
        assert slow.outcome is Outcome.SUCCEEDED, slow.message
        assert quick.outcome is Outcome.SUCCEEDED, quick.message
        np.testing.assert_allclose(robot.image.position[:3], 0.4, atol=1e-3)
        np.testing.assert_allclose(robot.image.position[3:], -0.2, atol=1e-3)


def test_a_stream_of_one_group_leaves_the_goal_of_the_other_alone(tmp_path: Path) -> None:
    with open_robot(grouped(tmp_path), "wmx") as robot:
        front, back = robot.groups["front"], robot.groups["back"]
        with front.follower.follow(to(front.joint_names, 0.4, 1.0)) as execution:
            with back.stream(timeout_s=2.0) as stream:
                eventually(
                    lambda: stream.send([0.1] * 3) is None and robot.image.position[4] > 0.09
                )
            assert execution.wait(10.0)
        assert execution.outcome is Outcome.SUCCEEDED, execution.message
        np.testing.assert_allclose(robot.image.position[3:], 0.1, atol=0.02)


def test_an_engine_that_interpolates_itself_has_no_groups(tmp_path: Path) -> None:
    with (
        pytest.raises(Unsupported, match="several joint groups"),
        open_robot(grouped(tmp_path, stream_positions=False), "wmx"),
    ):
        pass
