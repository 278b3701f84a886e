"""wmx/axis topics: moves and velocity commands arrive, bad ones are rejected and logged once."""

from __future__ import annotations

from typing import Any

import pytest
from tests.ros.robot_process import Client, RobotProcess, wait_until
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
    command(0.5)
    client.next(states, lambda each: each.actual_velocity[5] == pytest.approx(0.5, abs=0.05))
    command(0.0)
    client.next(states, lambda each: abs(each.actual_velocity[5]) < 0.005)
    wait_until(lambda: set_mode(0), "an idle axis takes the mode")


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

    def is_rejected() -> list[str]:
        publisher.publish(message)  # again: one that comes late is dropped
        return rejections()

    wait_until(is_rejected, f"{reason!r} in the log")
    for _ in range(5):
        publisher.publish(message)
    state = client.next(states)
    state = client.next(states)
    assert max(abs(velocity) for velocity in state.actual_velocity) < 0.01
    assert len(rejections()) == 1
