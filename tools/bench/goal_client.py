"""Times of goals and cancels, by a client that costs next to nothing.

``python -m tools.bench.goal_client ACTION COUNT`` prints JSON.
"""

from __future__ import annotations

import json
import sys
import time
import uuid

import numpy as np
import rclpy
from action_msgs.srv import CancelGoal
from control_msgs.action import FollowJointTrajectory
from rclpy.node import Node
from tools.bench.client import swing
from tools.bench.fast_client import FastClient
from tools.bench.percentiles import percentiles
from unique_identifier_msgs.msg import UUID

REST_S = 0.05
SHORT_S = 0.3
MOVING_S = 0.4  # before a cancel
SWING_S, AMPLITUDE_RAD = 15.0, 0.5
IMPL = FollowJointTrajectory.Impl


class Goals:
    """Goals of one action, one after the other."""

    def __init__(self, node: Node, action: str) -> None:
        service = f"{action}/_action"
        self._send = FastClient(node, IMPL.SendGoalService, f"{service}/send_goal")
        self._cancel = FastClient(node, CancelGoal, f"{service}/cancel_goal")
        self._result = FastClient(node, IMPL.GetResultService, f"{service}/get_result")

    def run(self, *, cancels: bool) -> dict[str, float]:
        """Send a goal, wait for its end; times in µs."""
        identity = UUID(uuid=np.frombuffer(uuid.uuid4().bytes, np.uint8))
        duration_s = SWING_S if cancels else SHORT_S
        goal = swing(duration_s, AMPLITUDE_RAD if cancels else 0.001)
        message = self._send.prepare(IMPL.SendGoalService.Request(goal_id=identity, goal=goal))
        ask = self._result.prepare(IMPL.GetResultService.Request(goal_id=identity))
        request = CancelGoal.Request()
        request.goal_info.goal_id = identity
        cancel = self._cancel.prepare(request)
        start_ns = self._send.send(message)
        arrived_ns, response = self._send.receive()
        assert response.accepted
        times = {"accepted": (arrived_ns - start_ns) / 1000.0}
        self._result.send(ask)
        if cancels:
            time.sleep(MOVING_S)
            start_ns = self._cancel.send(cancel)
            times["canceled"] = (self._cancel.receive()[0] - start_ns) / 1000.0
        end_ns, _ = self._result.receive()
        if cancels:
            times["cancel_result"] = (end_ns - start_ns) / 1000.0
        else:  # it is planned and begun after it was accepted
            times["result"] = (end_ns - arrived_ns) / 1000.0 - SHORT_S * 1e6
        time.sleep(REST_S)
        return times


def main(action: str, count: int) -> None:
    context = rclpy.Context()
    rclpy.init(context=context)
    node = rclpy.create_node("goal_client", context=context)
    goals = Goals(node, action)
    goals.run(cancels=False)
    found: dict[str, list[float]] = {}
    for index in range(count):
        for name, value in goals.run(cancels=index % 3 == 2).items():
            found.setdefault(name, []).append(value)
    figures: dict[str, float] = {}
    for name, values in found.items():
        figures |= percentiles(name, np.array(values))
        figures[f"{name}_min_us"] = min(values)
        figures[f"{name}_p90_us"] = float(np.percentile(values, 90))
    print(json.dumps(figures))
    node.destroy_node()
    rclpy.shutdown(context=context)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
