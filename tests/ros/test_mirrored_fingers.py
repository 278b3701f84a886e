"""A gripper with mirrored fingers and other ends than the descriptor's: topics, tf and actions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from control_msgs.action import GripperCommand, ParallelGripperCommand
from sensor_msgs.msg import JointState
from tests.ros.action_client import GoalClient
from tests.ros.robot_process import (
    WAIT_S,
    Client,
    RobotProcess,
    connected,
    wait_for,
    wait_until,
)
from tf2_msgs.msg import TFMessage

pytestmark = [pytest.mark.daily, pytest.mark.ros]

OPEN_M, CLOSED_M, TRAVEL_S = 0.03, 0.005, 1.0
FINGERS = ["picker_1_joint", "picker_2_joint"]
PARALLEL = "/parallel_gripper_controller/gripper_cmd"


ROBOT = f"""\
schema: 1
name: mirrored
extends: cr3a
gripper: {{multipliers: [1.0, -1.0], travel_time_s: {TRAVEL_S}}}
nodes: [wmx_engine_node, wmx_io_node, manipulator_state, robot_state_publisher, gripper_controller]
ros_parameters:
  follow_joint_trajectory_server: null
  joint_command_node: null
  manipulator_state: {{gripper_open_value: {OPEN_M}, gripper_close_value: {CLOSED_M}}}
"""


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    folder = tmp_path_factory.mktemp("mirrored")
    (folder / "robot.yaml").write_text(ROBOT, encoding="utf-8")
    with RobotProcess(robot=str(folder), backend="sim") as process:
        process.wait_ready()
        with connected(process) as client:
            yield client


def parallel(client: Client, names: list[str], positions: list[float]) -> Any:
    """Send a goal; return its handle."""
    actions = GoalClient(client.node, ParallelGripperCommand, PARALLEL)
    assert actions.wait_for_server(WAIT_S)
    goal = ParallelGripperCommand.Goal()
    goal.command.name, goal.command.position = names, positions
    return wait_for(actions.send_goal_async(goal))


def result_of(handle: Any) -> tuple[int, Any]:
    assert handle.accepted
    answer = wait_for(handle.get_result_async())
    return answer.status, answer.result


def test_each_finger_has_its_own_position(client: Client) -> None:
    for position in (CLOSED_M, OPEN_M):
        status, result = result_of(parallel(client, FINGERS, [position, -position]))
        assert status == GoalStatus.STATUS_SUCCEEDED
        assert (result.reached_goal, result.stalled) == (True, False)
        assert list(result.state.name) == FINGERS
        assert list(result.state.position) == pytest.approx([position, -position])
    status, result = result_of(parallel(client, FINGERS[1:], [-CLOSED_M]))
    assert list(result.state.position) == pytest.approx([CLOSED_M, -CLOSED_M])
    status, result = result_of(parallel(client, [], [OPEN_M]))
    assert list(result.state.position) == pytest.approx([OPEN_M, -OPEN_M])


@pytest.mark.parametrize(
    ("names", "positions"),
    [
        (FINGERS, [CLOSED_M, CLOSED_M]),  # not mirrored
        (FINGERS, [CLOSED_M]),
        (FINGERS[1:], [CLOSED_M]),  # outside the stroke of this finger
        (["elbow"], [CLOSED_M]),
        ([], []),
        (FINGERS, [0.045, -0.045]),  # closed by the descriptor, beyond the parameters
    ],
)
def test_positions_that_the_fingers_cannot_have_are_rejected(
    client: Client, names: list[str], positions: list[float]
) -> None:
    assert not parallel(client, names, positions).accepted


def test_topics_tf_and_action_agree_about_the_ends(client: Client) -> None:
    states = client.listen(JointState, "/joint_states")
    transforms = client.listen(TFMessage, "/tf", 100)

    def moved(position: float) -> Any:
        """Return the picker's frame when the joint state says that it is at ``position``."""

        def is_there(state: JointState) -> bool:
            fingers = dict(zip(state.name, state.position, strict=True))
            return [fingers[name] for name in FINGERS] == pytest.approx([position, -position])

        client.next(states, is_there)
        message = client.next(transforms)
        frames = {transform.child_frame_id: transform.transform for transform in message.transforms}
        return frames["picker_1_link"].translation

    result_of(parallel(client, FINGERS, [OPEN_M, -OPEN_M]))
    opened = moved(OPEN_M)
    goal = GripperCommand.Goal()
    goal.command.position = CLOSED_M
    actions = GoalClient(client.node, GripperCommand, "/gripper_controller/gripper_cmd")
    assert actions.wait_for_server(WAIT_S)
    _, result = result_of(wait_for(actions.send_goal_async(goal)))
    assert (result.position, result.reached_goal) == (CLOSED_M, True)
    closed = moved(CLOSED_M)
    travel = [getattr(closed, axis) - getattr(opened, axis) for axis in "xyz"]
    assert sum(part**2 for part in travel) ** 0.5 == pytest.approx(OPEN_M - CLOSED_M, abs=1e-6)


def test_a_goal_that_is_canceled_on_the_way_says_where_the_fingers_are(client: Client) -> None:
    result_of(parallel(client, [], [CLOSED_M]))  # nothing reads the position meanwhile

    def canceled() -> Any:
        """Return the result of a goal that had begun; before, it says nothing of the fingers."""
        handle = parallel(client, [], [OPEN_M])
        wait_for(handle.cancel_goal_async())
        status, result = result_of(handle)
        assert status == GoalStatus.STATUS_CANCELED
        return result if result.state.position else None

    result = wait_until(canceled, "a goal that is canceled on the way")
    assert CLOSED_M <= result.state.position[0] < CLOSED_M + 0.9 * (OPEN_M - CLOSED_M)
    assert result.state.position[1] == -result.state.position[0]
