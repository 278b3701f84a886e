"""``robotd pose`` against a robot in another process, and its services."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from robotd_msgs.msg import SavedPoses
from robotd_msgs.srv import DeletePose, PlanPose, RenamePose, SavePose
from tests.ros.robot_process import LATCHED, Client, RobotProcess, connected, wait_until
from tests.ros.test_client_commands import positions, robotd

pytestmark = pytest.mark.ros


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RobotProcess]:
    file = tmp_path_factory.mktemp("arm") / "robot.yaml"
    file.write_text("extends: cr3a\nname: arm\nposes: poses.yaml\n", encoding="utf-8")
    with RobotProcess(robot=str(file), simulated_time=True, backend="sim") as process:
        process.wait_ready()
        yield process


@pytest.fixture(scope="module")
def client(arm: RobotProcess) -> Iterator[Client]:
    with connected(arm) as client:
        yield client


def test_an_arm_goes_to_a_pose_that_was_saved(arm: RobotProcess, client: Client) -> None:
    told = client.listen(SavedPoses, "/robotd/poses", LATCHED)
    assert robotd(arm.domain, "pose", "save", "home")[0] == 0
    assert robotd(arm.domain, "move", "joint1=0.4", "joint3=-0.3")[0] == 0
    code, output, _ = robotd(arm.domain, "pose", "save", "bent")
    assert (code, output.split(",")[0]) == (0, "bent: joint1 +0.400")
    wait_until(
        lambda: told and [pose.name for pose in told[-1].poses] == ["home", "bent"], "both poses"
    )
    code, output, _ = robotd(arm.domain, "pose", "go", "home", "--speed", "1")
    assert code == 0
    assert output.startswith("goal reached after ")
    assert positions(arm.domain)[:3] == pytest.approx([0.0, 0.0, 0.0], abs=2e-3)
    output = robotd(arm.domain, "pose", "list")[1]
    joints, tools = output.splitlines()[:2], output.splitlines()[2:]
    assert [line.split()[:3] for line in joints] == [
        ["home", "joint1", "+0.000"],
        ["bent", "joint1", "+0.400"],
    ]
    assert [line.split(" at ")[0] for line in tools] == [
        "home: link in base",
        "bent: link in base",
    ]


def test_the_tool_goes_to_a_pose_on_a_line(arm: RobotProcess) -> None:
    assert robotd(arm.domain, "move", "joint2=-0.4", "joint3=1.4", "joint5=1.0")[0] == 0
    assert robotd(arm.domain, "pose", "save", "above", "--replace")[0] == 0
    assert robotd(arm.domain, "move", "--tool", "z+0.03", "--line")[0] == 0
    there = positions(arm.domain)
    code, output, error = robotd(arm.domain, "pose", "go", "above", "--line", "--speed", "1")
    assert code == 0, output + error
    found = positions(arm.domain)
    assert found[1:3] == pytest.approx([-0.4, 1.4], abs=5e-3)
    assert abs(found[1] - there[1]) > 0.01


def test_what_cannot_be_is_named(arm: RobotProcess) -> None:
    robotd(arm.domain, "pose", "save", "rest", "--replace")
    for words, reason in (
        (("go", "rust"), "unknown pose 'rust'; did you mean 'rest'?"),
        (("save", "rest"), "there is a pose 'rest' already"),
        (("save", "a b"), "'a b' is not a valid name of a pose"),
        (("delete", "none"), "unknown pose 'none'"),
        (("save", "all", "--group", "legs"), "unknown joint group 'legs'"),
    ):
        code, _, error = robotd(arm.domain, "pose", *words)
        assert code == 1, words
        assert reason in error, words
    assert robotd(arm.domain, "stop")[0] == 0
    try:
        code, _, error = robotd(arm.domain, "pose", "go", "rest")
        assert (code, "stopped" in error) == (1, True), error
    finally:
        assert robotd(arm.domain, "reset")[0] == 0


@pytest.mark.parametrize(
    ("service", "name", "values", "reason"),
    [
        (SavePose, "save", {}, "'' is not a valid name of a pose"),
        (PlanPose, "plan", {"name": "rest", "speed": 2.0}, "speed is 2, must be 0.01 to 1"),
        (PlanPose, "plan", {"name": "rest", "speed": float("nan")}, "speed is nan, must be"),
        (RenamePose, "rename", {"name": "rest"}, "'' is not a valid name of a pose"),
        (DeletePose, "delete", {}, "unknown pose ''"),
    ],
)
def test_a_request_that_is_wrong_is_answered(
    client: Client,
    arm: RobotProcess,
    service: Any,
    name: str,
    values: dict[str, object],
    reason: str,
) -> None:
    robotd(arm.domain, "pose", "save", "rest", "--replace")
    answer = client.call(service, f"/robotd/poses/{name}", **values)
    assert not answer.success
    assert reason in answer.message


def test_the_file_is_beside_that_of_the_robot(arm: RobotProcess, client: Client) -> None:
    robotd(arm.domain, "pose", "save", "rest", "--replace")
    robot = Path(arm.process.args[arm.process.args.index("--robot") + 1])  # type: ignore[call-overload, union-attr]
    assert "rest: {joint1: " in (robot.parent / "poses.yaml").read_text(encoding="utf-8")
