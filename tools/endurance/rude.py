"""Clients that misbehave: ``python -m tools.endurance.rude KIND DOMAIN``, until it is ended."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from itertools import count
from typing import Any

import click
import numpy as np
from action_msgs.srv import CancelGoal
from control_msgs.action import FollowJointTrajectory
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from tests.ros.action_client import GoalClient
from tests.ros.robot_process import ACTION, WAIT_S, Client, wait_for
from tools.endurance.goals import goal_of
from tools.endurance.lives import JOINTS
from wmx_ros2_message.msg import AxisPose, AxisState, AxisVelocity
from wmx_ros2_message.srv import EcatGetNetworkState

CROWD = 1000
FLOOD_HZ = 10_000
PROFILE = {"velocity": [0.1], "acc": [1.0], "dec": [1.0]}
# All of them are rejected: what is obeyed would be in the way of the honest client.
FLOODED = (
    (AxisVelocity, "/wmx/axis/velocity", AxisVelocity(index=[0], **PROFILE)),
    (AxisPose, "/wmx/axis/position", AxisPose(index=[0], target=[99.0], **PROFILE)),
    (AxisPose, "/wmx/axis/position/relative", AxisPose(index=[0], target=[99.0], **PROFILE)),
)
SLOW = (  # answered by workers
    (Trigger, "/wmx/engine/scan_network"),
    (EcatGetNetworkState, "/wmx/ecat/get_network_state"),
)


def vanish(client: Client) -> None:
    """Send a long goal and wait to be killed."""
    goal = client.send_goal(goal_of(JOINTS, [(8.0, [1.0] * len(JOINTS))]))
    announce()
    goal.result()


def crowd(client: Client) -> None:
    """Send 1000 goals at once, good ones, and ask for all their results."""
    actions = _actions(client)
    goals = [goal_of(JOINTS, [(1.0, [0.1] * len(JOINTS))]) for _ in range(CROWD)]
    announce()
    for goal in goals:
        actions.send_goal_async(goal).add_done_callback(_ask_for_result)
    threading.Event().wait()


def strangers(client: Client) -> None:
    """Cancel goals that nobody has sent."""
    cancel = client.node.create_client(CancelGoal, f"{ACTION}/_action/cancel_goal")
    assert cancel.wait_for_service(WAIT_S)
    announce()
    chance = np.random.default_rng(1)
    while True:
        request = CancelGoal.Request()
        request.goal_info.goal_id.uuid = chance.integers(0, 256, 16, dtype=np.uint8)
        assert not wait_for(cancel.call_async(request)).goals_canceling


def flood(client: Client, rate_hz: float = FLOOD_HZ) -> None:
    """Publish commands on all topics of the axes, by default 10 000 a second in all."""
    publishers = [client.publisher(kind, topic) for kind, topic, _ in FLOODED]
    messages = [message for _, _, message in FLOODED]
    announce()
    began_s = time.monotonic()
    for number in count():
        publishers[number % 3].publish(messages[number % 3])
        if number % 50 == 0:
            time.sleep(max(0.0, began_s + number / rate_hz - time.monotonic()))


def deaf(client: Client) -> None:
    """Subscribe reliably to everything that is fast; stopping this process makes it deaf."""
    joints = client.listen(JointState, "/joint_states", QoSProfile(depth=1000))
    states = client.listen(AxisState, "/wmx/axis/state", QoSProfile(depth=1000))
    client.next(joints)
    client.next(states)
    announce()
    while True:
        time.sleep(1.0)
        joints.clear()
        states.clear()


def hasty(client: Client) -> None:
    """Open clients of services, call, and go before the answer."""
    announce()
    for number in count():
        kind, name = SLOW[number % 2]
        service = client.node.create_client(kind, name)
        service.wait_for_service(WAIT_S)
        for _ in range(20):
            service.call_async(kind.Request())
        client.node.destroy_client(service)


def announce() -> None:
    """Tell the parent that it begins."""
    click.echo("misbehaving")


def _ask_for_result(sent: Any) -> None:
    if sent.result().accepted:
        sent.result().get_result_async()


def _actions(client: Client) -> GoalClient:
    actions = GoalClient(
        client.node,
        FollowJointTrajectory,
        ACTION,
        goal_service_qos_profile=QoSProfile(depth=CROWD),
        result_service_qos_profile=QoSProfile(depth=CROWD),
    )
    assert actions.wait_for_server(WAIT_S)
    return actions


KINDS: dict[str, Callable[..., Any]] = {
    behaviour.__name__: behaviour for behaviour in (vanish, crowd, strangers, flood, deaf, hasty)
}


@click.command()
@click.argument("kind", type=click.Choice([*KINDS]))
@click.argument("domain", type=int)
@click.option("--rate-hz", type=float, help="Of a flood.")
def main(kind: str, domain: int, rate_hz: float | None) -> None:
    """Misbehave until somebody ends it."""
    options = {} if rate_hz is None else {"rate_hz": rate_hz}
    KINDS[kind](Client(domain), **options)


if __name__ == "__main__":
    main()
