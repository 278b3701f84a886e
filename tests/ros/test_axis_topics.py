"""wmx/axis topics: moves and velocity commands arrive, bad ones are rejected and logged once."""

from __future__ import annotations

import time
from typing import Any

import pytest
from tests.ros.robot_process import Client, RobotProcess, command_until, wait_until
from wmx_ros2_message.msg import AxisPose, AxisState, AxisVelocity
from wmx_ros2_message.srv import SetAxis

pytestmark = [pytest.mark.daily, pytest.mark.ros, pytest.mark.second_backend]


@pytest.fixture(scope="module")
def states(client: Client) -> list[Any]:
    return client.listen(AxisState, "/wmx/axis/state")


def pose(index: list[int], target: list[float], speed: float = 2.0) -> Any:
    count = len(index)
    ramp = [8.0] * count
    return AxisPose(index=index, target=target, velocity=[speed] * count, acc=ramp, dec=ramp)


def at(states: list[Any], axis: int, position: float) -> bool:
    state = states[-1]
    return abs(state.actual_pos[axis] - position) < 2e-3 and state.motion_complete[axis]


def test_absolute_then_relative_moves(client: Client, states: list[Any]) -> None:
    client.next(states)
    absolute = client.publisher(AxisPose, "/wmx/axis/position")
    relative = client.publisher(AxisPose, "/wmx/axis/position/relative")
    absolute.publish(pose([0, 3], [0.2, -0.3]))
    wait_until(lambda: at(states, 0, 0.2) and at(states, 3, -0.3), "absolute targets")
    relative.publish(pose([0], [0.1]))
    wait_until(lambda: at(states, 0, 0.3), "relative target")
    absolute.publish(pose([0, 3], [0.0, 0.0]))
    wait_until(lambda: at(states, 0, 0.0) and at(states, 3, 0.0), "back at zero")


def test_velocity_turns_the_axis_until_it_is_told_to_stop(
    client: Client, states: list[Any]
) -> None:
    publisher = client.publisher(AxisVelocity, "/wmx/axis/velocity")

    def command(velocity: float) -> None:
        publisher.publish(AxisVelocity(index=[5], velocity=[velocity], acc=[5.0], dec=[5.0]))

    def set_mode(mode: int) -> bool:
        return bool(client.call(SetAxis, "/wmx/axis/set_mode", index=[5], data=[mode]).success)

    assert set_mode(1)
    # After a flood that was rejected the topic has to be silent, or to ask for rest, first.
    command_until(
        lambda: command(0.5),
        lambda: states[-1].actual_velocity[5] == pytest.approx(0.5, abs=0.05),
        "the axis turns",
    )
    command(0.0)
    client.next(states, lambda message: abs(message.actual_velocity[5]) < 0.005)
    wait_until(lambda: set_mode(0), "an idle axis takes the mode")


def test_a_flood_of_commands_of_one_axis_drops_no_stop_of_another(
    cr3a: RobotProcess, client: Client, states: list[Any]
) -> None:
    publisher = client.publisher(AxisVelocity, "/wmx/axis/velocity")

    def command(axis: int, velocity: float) -> None:
        publisher.publish(AxisVelocity(index=[axis], velocity=[velocity], acc=[5.0], dec=[5.0]))

    def set_mode(mode: int) -> bool:
        answer = client.call(SetAxis, "/wmx/axis/set_mode", index=[4, 5], data=[mode] * 2)
        return bool(answer.success)

    def flood(messages: int) -> None:
        for number in range(messages):
            command(4, 0.1 + number % 2 * 0.01)
            if number % 20 == 0:
                time.sleep(0.004)  # far more than are handled, no more than are received

    assert set_mode(1)
    command(4, 0.0)
    command_until(
        lambda: command(5, 0.2), lambda: states[-1].actual_velocity[5] > 0.15, "the axis turns"
    )
    wait_until(lambda: flood(200) or "exceed the rate limit" in cr3a.output, "dropped messages")
    command(5, 0.0)
    flood(200)
    command(4, 0.0)
    wait_until(
        lambda: not any(abs(states[-1].actual_velocity[axis]) > 5e-3 for axis in (4, 5)),
        "both stop",
    )
    assert states[-1].actual_pos[5] < 2.5, "it has run to its position limit"
    wait_until(lambda: set_mode(0), "idle axes take the mode")


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (pose([0], []), "target has 0 values for 1 axes"),
        (pose([], []), "no axis given"),
        (pose([17], [0.0]), "axis 17 is outside 0..5"),
        (pose([2, 2], [0.0, 0.0]), "axis 2 is given twice"),
        (pose([1], [3.5]), "joint2: target 3.5 rad exceeds 3.14 rad"),
        (pose([2], [float("nan")]), "joint3: target is nan"),
        (pose([3], [0.1], speed=9.0), "joint4: velocity 9 rad/s exceeds 3.14 rad/s"),
        (pose([4], [0.1], speed=0.0), "joint5: velocity is 0, must be positive"),
    ],
)
def test_bad_moves_are_rejected_and_logged_once(
    cr3a: RobotProcess, client: Client, states: list[Any], message: Any, reason: str
) -> None:
    def rejections() -> list[str]:
        lines = cr3a.output.splitlines()
        return [line for line in lines if "command rejected" in line and reason in line]

    publisher = client.publisher(AxisPose, "/wmx/axis/position")
    command_until(lambda: publisher.publish(message), rejections, f"{reason!r} in the log")
    for _ in range(5):
        publisher.publish(message)
    state = client.next(states)
    state = client.next(states)
    assert max(abs(velocity) for velocity in state.actual_velocity) < 0.01
    assert len(rejections()) == 1
