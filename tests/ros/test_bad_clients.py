"""Clients that misbehave; ``python -m tools.endurance.clients`` has more of them, for longer."""

from __future__ import annotations

import pytest
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger
from tests.ros.robot_process import Client, wait_for
from tools.endurance.clients import endure

pytestmark = pytest.mark.ros


# A fifth of the tool's flood: the processor may be busy with others. It is still more than commands
# get time for.
@pytest.mark.parametrize(
    ("kind", "options"), [("crowd", ()), ("deaf", ()), ("flood", ("--rate-hz", "2000"))]
)
def test_a_robot_bears_them_and_works_afterwards(kind: str, options: tuple[str, ...]) -> None:
    seen = endure(kind, 2.0, *options)
    assert not seen.problem, seen.problem
    # A long stall of a busy computer ends a goal; the robot says so.
    assert not [failure for failure in seen.failures if "control-loop stall" not in failure]


@pytest.mark.daily
@pytest.mark.parametrize("name", ["/wmx/engine/get_status", "/wmx/engine/scan_network"])
def test_every_call_of_a_burst_is_answered(client: Client, name: str) -> None:
    burst = 200
    service = client.node.create_client(Trigger, name, qos_profile=QoSProfile(depth=burst))
    assert service.wait_for_service(20.0)
    answers = [service.call_async(Trigger.Request()) for _ in range(burst)]
    for answer in answers:
        assert wait_for(answer).message
    client.node.destroy_client(service)
