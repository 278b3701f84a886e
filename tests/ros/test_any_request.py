"""Requests with random content: all are answered, nothing moves, and nothing is kept of them."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger
from tests.ros.random_messages import RandomMessages, type_named
from tests.ros.robot_process import Client, RobotProcess, connected, names_of, wait_for, wait_until
from wmx_ros2_message.srv import GetWmxParams, LoadWmxParams

from robotd.errors import OperationError
from robotd_testing.served_robot import RobotUnderTest

pytestmark = pytest.mark.ros
pytest_plugins = ["robotd_testing.robots"]

OF_NODE, OF_ACTION = 6, 3  # services that each has beside those of the robot
SLOW = (  # called less often: recordings are saved by a process
    *("/robotd/record", "/robotd/snapshot", "/robotd/stop", "/robotd/recover"),
    "/wmx/engine/scan_network",
)
BATCH = 40
ALL = QoSProfile(depth=BATCH)  # of one service: the usual depth drops what exceeds ten
AT_REST_RAD_S = 1e-9
MAX_GROWTH_MIB = 160  # the middleware keeps a buffer of the largest request of each service
MAX_NEW_HANDLES = 16  # of a recording, and of workers that were not needed before


class Peer:
    """A client that calls everything that a robot serves, with random values."""

    def __init__(self, client: Client, robot: RobotProcess, seed: int) -> None:
        self._messages, self._node = RandomMessages(seed), client.node
        wait_until(lambda: len(self._listed()) == served_count(robot), "all services in the graph")
        self.services = {
            name: self._node.create_client(type_named(kind), name, qos_profile=ALL)
            for name, kind in self._listed().items()
        }
        self.topics = {
            name: self._node.create_publisher(type_named(kind), name, ALL)
            for name, kind in names_of(self._node.get_topic_names_and_types()).items()
            if self._is_taken(name)
        }
        names = {*self.topics, *self.services}
        self._names = sorted(names.difference(SLOW)) * 10
        self._names += SLOW
        wait_until(lambda: all(map(self._is_found, {*self._names})), "all services and topics")

    def _listed(self) -> dict[str, str]:
        """Name → type of the services of others."""
        found = names_of(self._node.get_service_names_and_types())
        return {name: kind for name, kind in found.items() if not name.startswith("/client/")}

    def _is_taken(self, topic: str) -> bool:
        """Whether the robot subscribes to ``topic``."""
        found = self._node.get_subscriptions_info_by_topic(topic)
        return any(endpoint.node_name != self._node.get_name() for endpoint in found)

    def call(self, count: int) -> None:
        """Make ``count`` calls; fails with the name of what does not answer."""
        for begin in range(0, count, BATCH):
            begun = [self._begin() for _ in range(min(BATCH, count - begin))]
            # Simulated time may have been stopped, and answers may take some of it.
            self._ask("/robotd_sim/pause", SetBool.Request(data=False))
            for name, answer in begun:
                try:
                    wait_for(answer)
                except AssertionError as error:
                    raise AssertionError(f"{name} does not answer") from error
            if not self._ask("/wmx/engine/get_status", Trigger.Request()).success:
                self._ask("/robotd/recover", Trigger.Request())

    def _begin(self) -> tuple[str, Any]:
        name = self._messages.random.choice(self._names)
        if (publisher := self.topics.get(name)) is not None:
            publisher.publish(self._messages.filled(publisher.msg_type(), is_command=True))
            name = "/wmx/engine/get_status"  # answered by the thread that takes messages
        client = self.services[name]
        request = client.srv_type.Request()
        return name, client.call_async(
            self._messages.filled(request, is_command="/_action/" in name)
        )

    def _ask(self, name: str, request: Any) -> Any:
        return wait_for(self.services[name].call_async(request))

    def _is_found(self, name: str) -> bool:
        if (publisher := self.topics.get(name)) is not None:
            return bool(publisher.get_subscription_count())
        return bool(self.services[name].service_is_ready())


def served_count(robot: RobotProcess) -> int:
    """Number of all services of a robot, from its start page."""
    line = re.search(r"(\d+) nodes, \d+ topics, (\d+) services, (\d+) actions", robot.output)
    assert line, robot.output
    nodes, services, actions = map(int, line.groups())
    return services + OF_NODE * nodes + OF_ACTION * actions


class Resources:
    """Memory, open files and threads of a process."""

    def __init__(self, process: RobotProcess) -> None:
        folder = Path("/proc") / str(process.process.pid)
        status = (folder / "status").read_text(encoding="ascii")
        self.memory_mib = int(status.partition("VmRSS:")[2].split()[0]) / 1024
        self.files = len([*(folder / "fd").iterdir()])
        self.threads = len([*(folder / "task").iterdir()])


@pytest.mark.parametrize(
    ("seed", "count"), [pytest.param(1, 400, marks=pytest.mark.daily), pytest.param(2, 5000)]
)
def test_any_request(seed: int, count: int) -> None:
    with RobotProcess(simulated_time=True) as robot:
        robot.wait_ready()
        with connected(robot) as client:
            states = client.listen(JointState, "/joint_states")
            peer = Peer(client, robot, seed)
            peer.call(count // 4)  # brings workers and buffers into being
            before = Resources(robot)
            peer.call(count - count // 4)
            after = Resources(robot)
        moving = [state for state in states if max(map(abs, state.velocity)) > AT_REST_RAD_S]
        assert not moving, moving[0]
        assert after.memory_mib - before.memory_mib < MAX_GROWTH_MIB
        assert after.files - before.files < MAX_NEW_HANDLES
        assert after.threads - before.threads < MAX_NEW_HANDLES
        for fault in ("[error", "Traceback", "internal error", "\x1b"):
            assert fault not in robot.output


@pytest.fixture
def robot(robotd_robot: Callable[..., RobotUnderTest]) -> RobotUnderTest:
    return robotd_robot("cr3a", time_scale=5.0)


@pytest.mark.daily
def test_a_parameter_file_that_is_none(robot: RobotUnderTest, tmp_path: Path) -> None:
    pipe, large, full = tmp_path / "pipe", tmp_path / "large", tmp_path / "full"
    os.mkfifo(pipe)
    large.touch()
    os.truncate(large, 10_000_000_000)
    full.write_text(f"<Parameters>{'<AxisPolarity/>' * 140_000}</Parameters>")
    for path, reason in (
        (pipe, "is not a file"),
        (Path("/dev/zero"), "is not a file"),
        (tmp_path, "is not a file"),
        (large, "larger than the limit of 4_000_000 bytes"),
        (full, "and 950 more problems"),
    ):
        with pytest.raises(OperationError, match=reason):
            robot.call(LoadWmxParams, "wmx/params/load", file_path=str(path))


@pytest.mark.daily
def test_parameters_of_no_axis_are_those_of_every_axis(robot: RobotUnderTest) -> None:
    every = robot.call(GetWmxParams, "wmx/params/get", index=range(6)).params_dump
    assert robot.call(GetWmxParams, "wmx/params/get").params_dump == every
