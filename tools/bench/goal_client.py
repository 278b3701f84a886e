"""Times of goals and cancels, by a client that costs next to nothing.

``python -m tools.bench.goal_client ACTION COUNT`` prints JSON. The request is converted before
the clock starts, sent by rcl and awaited in a wait set of one client, as a C program would do it;
rclpy's ``ActionClient`` would add about a millisecond.
"""

from __future__ import annotations

import ctypes
import json
import sys
import time
import uuid
from typing import Any

import numpy as np
import rclpy
from action_msgs.srv import CancelGoal
from control_msgs.action import FollowJointTrajectory
from rclpy._rclpy_pybind11 import WaitSet
from rclpy.client import Client
from rclpy.node import Node
from tools.bench.client import swing
from tools.bench.figures import percentiles
from unique_identifier_msgs.msg import UUID

WAIT_S = 20.0
REST_S = 0.05
MOVING_S = 0.4  # before a cancel
SWING_S, AMPLITUDE_RAD = 15.0, 0.5
IMPL = FollowJointTrajectory.Impl
_rcl = ctypes.CDLL("librcl.so")
_rcl.rcl_send_request.argtypes = [
    ctypes.c_void_p,
    ctypes.c_void_p,
    ctypes.POINTER(ctypes.c_int64),
]
_capsule = ctypes.pythonapi.PyCapsule_GetPointer
_capsule.argtypes, _capsule.restype = [ctypes.py_object, ctypes.c_char_p], ctypes.c_void_p


class FastClient:
    """A service's client: ``prepare`` a request, ``send`` it, ``receive`` the response."""

    def __init__(self, node: Node, service_type: Any, name: str) -> None:
        self._client: Client = node.create_client(service_type, name)
        assert self._client.wait_for_service(WAIT_S), f"no service {name}"
        self._type = service_type
        self._context = node.context
        support: Any = type(service_type.Request)
        support.__import_type_support__()
        self._create = ctypes.CFUNCTYPE(ctypes.c_void_p)(_address(support, "_CREATE_ROS_MESSAGE"))
        self._convert = ctypes.PYFUNCTYPE(ctypes.c_bool, ctypes.py_object, ctypes.c_void_p)(
            _address(support, "_CONVERT_FROM_PY")
        )

    def prepare(self, request: Any) -> int:
        """Return the C message of ``request``; it is never freed."""
        message = self._create()
        assert self._convert(request, message)
        return int(message)

    def send(self, message: int) -> int:
        """Send; return the time just before, ns."""
        number = ctypes.c_int64()
        start_ns = time.perf_counter_ns()
        with self._client.handle:
            assert not _rcl.rcl_send_request(
                self._client.handle.pointer, message, ctypes.byref(number)
            )
        return start_ns

    def receive(self) -> tuple[int, Any]:
        """Wait for the response; return the time of its arrival, ns, and it."""
        deadline = time.monotonic() + WAIT_S
        while time.monotonic() < deadline:
            with self._client.handle, self._context.handle:
                wait_set = WaitSet(0, 0, 0, 1, 0, 0, self._context.handle)
                with wait_set:
                    wait_set.clear_entities()
                    wait_set.add_client(self._client.handle)
                    wait_set.wait(int(0.5e9))
                arrived_ns = time.perf_counter_ns()
                header, response = self._client.handle.take_response(self._type.Response)
            if header is not None:
                return arrived_ns, response
        raise TimeoutError(self._client.srv_name)


def _address(support: Any, name: str) -> int:
    return int(_capsule(getattr(support, name), None))


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
        duration_s = SWING_S if cancels else 0.3
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
