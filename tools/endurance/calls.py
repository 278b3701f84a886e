"""Service calls of all kinds: reading, gripper, outputs, parameters."""

from __future__ import annotations

import random
import threading
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from std_srvs.srv import SetBool, Trigger
from tests.ros.robot_process import WAIT_S, Client, wait_for
from tools.endurance.pace import Pace
from wmx_ros2_message.srv import (
    EcatGetNetworkState,
    GetIoBit,
    GetIoBytes,
    GetWmxParams,
    LoadWmxParams,
    SetIoBit,
)

from robotd.descriptor import RobotDescriptor

SPARE_BIT = 7  # of the gripper's byte, or of byte 0
END_S = 10.0  # for the answers that are under way
PENDING = 20  # a client that is answered slowly does not pile up more


@dataclass(frozen=True)
class Call:
    """A service with requests at random, ``weight`` times as often as one of weight 1.

    Attributes:
        may_refuse: at the wrong moment it says no, as it should.
    """

    weight: float
    service_type: Any
    name: str
    request: Callable[[random.Random], dict[str, Any]] = lambda _: {}
    may_refuse: bool = False


class ServiceCalls:
    """Calls the services of a robot at random, ``rate_hz`` times a second.

    Counts ``calls``, ``answered``, ``rejected`` (with the reasons), and by service ``done`` and
    ``not now``.
    """

    def __init__(
        self,
        client: Client,
        descriptor: RobotDescriptor,
        counts: Counter[str],
        chance: random.Random,
        rate_hz: float,
    ) -> None:
        self._client, self._counts, self._chance = client, counts, chance
        self._pace = Pace(rate_hz)
        self._calls = calls_of(descriptor)
        self._pending = 0
        self._lock = threading.Lock()  # answers are counted in the client's own thread

    def run(self, ended: threading.Event) -> None:
        clients = {}
        for call in list(self._calls):
            client = self._client.node.create_client(call.service_type, call.name)
            assert client.wait_for_service(WAIT_S), f"no service {call.name}"
            clients[call.name] = client
            answer = wait_for(client.call_async(self._request(call)))
            if "not supported" in getattr(answer, "message", ""):
                self._calls.remove(call)
        weights = [call.weight for call in self._calls]
        while self._pace.wait(ended):
            if self._pending < PENDING:
                self._send(clients, self._chance.choices(self._calls, weights)[0])
        deadline = time.monotonic() + END_S
        while self._pending and time.monotonic() < deadline:
            time.sleep(0.01)

    def _request(self, call: Call) -> Any:
        return call.service_type.Request(**call.request(self._chance))

    def _send(self, clients: dict[str, Any], call: Call) -> None:
        with self._lock:
            self._pending += 1
            self._counts["calls"] += 1
        future = clients[call.name].call_async(self._request(call))
        future.add_done_callback(lambda future: self._answered(call, future.result()))

    def _answered(self, call: Call, answer: Any) -> None:
        with self._lock:
            self._pending -= 1
            self._counts["answered"] += 1
            if answer.success:
                self._counts[f"done {call.name}"] += 1
            elif call.may_refuse:
                self._counts[f"not now {call.name}"] += 1
            else:
                self._counts["rejected"] += 1
                self._counts[f"rejected {call.name}: {answer.message}"] += 1


def calls_of(descriptor: RobotDescriptor) -> list[Call]:
    """Services of a robot's nodes, and those that its backend does not support."""
    gripper = descriptor.gripper
    byte = gripper.output_byte if gripper else 0
    calls = {
        "wmx_engine_node": [Call(30, Trigger, "/wmx/engine/get_status")],
        "wmx_io_node": [
            Call(20, GetIoBit, "/wmx/io/get_input_bit"),
            Call(10, GetIoBytes, "/wmx/io/get_output_bytes", lambda _: {"length": 1}),
            Call(
                10,
                SetIoBit,
                "/wmx/io/set_output_bit",
                lambda chance: {"byte": byte, "bit": SPARE_BIT, "value": chance.randint(0, 1)},
            ),
        ],
        "wmx_ethercat_node": [Call(20, EcatGetNetworkState, "/wmx/ecat/get_network_state")],
    }
    found = [call for node in descriptor.nodes for call in calls.get(node, ())]
    parameters = descriptor.ros_parameters.get("follow_joint_trajectory_server", {})
    if name := parameters.get("wmx_gripper_topic"):
        found.append(Call(4, SetBool, f"/{name}", lambda chance: {"data": chance.random() < 0.5}))
    if "wmx_core_motion_node" in descriptor.nodes and descriptor.parameters_file:
        file = {"file_path": str(descriptor.parameters_file)}
        found.append(Call(5, GetWmxParams, "/wmx/params/get", lambda _: {"index": [0]}))
        found.append(Call(0.1, LoadWmxParams, "/wmx/params/load", lambda _: file, may_refuse=True))
    return found
