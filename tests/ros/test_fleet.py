"""Several robots of one domain: their list, and a stop of all."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest
from std_msgs.msg import Empty, String
from std_srvs.srv import Trigger
from tests.ros.robot_process import LATCHED, Client, RobotProcess, wait_until

from robotd_ros.node_names import SUMMARY
from robotd_testing.domain import own_domain

pytestmark = pytest.mark.ros


def run(domain: int, *words: str, check: bool = True) -> subprocess.CompletedProcess[str]:
    variables = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    return subprocess.run(
        [sys.executable, "-m", "robotd", *words],
        env=os.environ | variables,
        capture_output=True,
        text=True,
        timeout=120,
        check=check,
    )


def listed(domain: int) -> dict[str, dict[str, Any]]:
    return {robot["namespace"]: robot for robot in json.loads(run(domain, "list", "--json").stdout)}


@pytest.fixture
def robots() -> Iterator[tuple[RobotProcess, RobotProcess]]:
    with (
        own_domain() as domain,
        RobotProcess("--ros-args", "-r", "__ns:=/left", domain=domain) as left,
        RobotProcess(
            *("--set", "engine.enable_at_start=false", "--ros-args", "-r", "__ns:=/right"),
            domain=domain,
        ) as right,
    ):
        left.wait_ready()
        right.wait_ready()
        yield left, right


def test_all_robots_are_listed_with_their_state_and_stopped(
    robots: tuple[RobotProcess, RobotProcess],
) -> None:
    left, _ = robots
    domain = left.domain
    # A busy computer may discover one of them later than the list waits.
    found: dict[str, dict[str, Any]] = {}
    wait_until(lambda: found.update(listed(domain)) or len(found) == 2, "both robots")
    assert {name: robot["state"] for name, robot in found.items()} == {
        "/left": "ready",
        "/right": "servo off",
    }
    assert found["/right"]["problems"][0].endswith("servo off")
    assert found["/left"]["pid"] == left.process.pid
    assert found["/left"]["simulated"] is True

    stopped = run(domain, "stop", "--all").stdout
    assert "/left: stopped, at rest" in stopped
    assert "/right: stopped, at rest" in stopped
    wait_until(lambda: listed(domain)["/left"]["state"] == "stopped", "the state is listed")

    client = Client(domain)
    reasons = [
        client.listen(String, f"/{name}/robotd/stopped", LATCHED) for name in ("left", "right")
    ]
    for name in ("left", "right"):
        assert client.call(Trigger, f"/{name}/robotd/reset").success
    wait_until(
        lambda: all(messages and not messages[-1].data for messages in reasons), "motion is allowed"
    )
    stop_all = client.publisher(Empty, "/robotd/stop_all")
    wait_until(lambda: stop_all.get_subscription_count() == 2, "both robots")
    stop_all.publish(Empty())
    wait_until(lambda: all(messages[-1].data for messages in reasons), "one message stops both")
    client.close()


def test_a_stop_of_nothing_says_so() -> None:
    with own_domain() as domain:
        failed = run(domain, "stop", "--all", "--timeout", "3", check=False)
    assert failed.returncode == 1
    assert "no robot runs in this ROS domain: nothing was stopped" in failed.stderr


FROZEN: dict[str, Any] = {"robot": "arm", "namespace": "/frozen", "backend": "sim"}
FROZEN |= {"computer": "elsewhere", "variant": "", "version": "0", "pid": 1}
FROZEN |= {"state": "ready", "uptime_s": 1.0, "problems": [], "owners": []}


@pytest.mark.parametrize(
    "summary", [FROZEN, FROZEN | {"namespace": "?"}, {}], ids=["known", "misnamed", "unreadable"]
)
def test_a_robot_that_does_not_confirm_is_named_and_the_others_are_stopped(
    summary: dict[str, Any],
) -> None:
    """Publish as a robot whose process is frozen: its topic is there, no service answers."""
    with own_domain() as domain, RobotProcess(domain=domain) as robot:
        robot.wait_ready()
        client = Client(domain)
        try:
            topic = client.node.create_publisher(String, f"/frozen/{SUMMARY}", LATCHED)
            topic.publish(String(data=json.dumps(summary)))
            if summary:
                wait_until(lambda: summary["namespace"] in listed(domain), "its summary")
            done: list[subprocess.CompletedProcess[str]] = []

            def both_are_found() -> bool:
                # Of a busy computer a robot may be discovered later than the command waits.
                done.append(run(domain, "stop", "--all", "--timeout", "8", check=False))
                return "/: " in done[-1].stdout and "/frozen: " in done[-1].stdout

            wait_until(both_are_found, "both robots")
            failed = done[-1]
            assert failed.returncode == 1
            assert "/: stopped, at rest" in failed.stdout
            assert "/frozen: NOT CONFIRMED: " in failed.stdout
            assert "/frozen" in failed.stderr, "it says that it tries"
        finally:
            client.close()
