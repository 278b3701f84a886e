"""``robotd recover`` of a robot that is restarted before it has answered."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.task import Future

from robotd.errors import DeviceTimeout
from robotd_ros.client import operator_client
from robotd_ros.client.operator_client import recover
from robotd_ros.client.ros_client import Listener, RosClient

TIMEOUT_S = 5.0


class Restarted:
    """Client whose robot is restarted when it is asked; the new one has the same names."""

    timeout_s = TIMEOUT_S
    service_name = "/robotd/recover"

    def __init__(self) -> None:
        self.node = self
        self.now_s, self._process = 100.0, 1
        self.wait = lambda *given: RosClient.wait(self, *given)  # type: ignore[arg-type]

    def monotonic(self) -> float:
        return self.now_s

    def spin(self) -> None:
        self.now_s += 0.02
        assert self.now_s < 200.0, "it waits for ever"

    def create_client(self, *_: Any) -> Any:
        return self

    def service_is_ready(self) -> bool:
        return True

    def call_async(self, _: Any) -> Future:
        self._process = 2
        return Future()

    def listen(self, kind: Any, topic: str, qos: Any) -> Listener:
        return Listener(self, kind, topic, qos)  # type: ignore[arg-type]

    def create_subscription(self, kind: Any, topic: str, receive: Any, qos: Any) -> Any:
        receive(kind())
        return SimpleNamespace(topic_name=topic)

    def destroy_subscription(self, _: Any) -> None:
        """The test is over."""

    def get_publishers_info_by_topic(self, _: str) -> list[Any]:
        return [SimpleNamespace(endpoint_gid=[self._process] * 16)]


def test_a_robot_that_is_restarted_ends_the_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    client = Restarted()
    monkeypatch.setattr(operator_client, "time", client)
    with pytest.raises(DeviceTimeout, match="the robot has gone during the recovery"):
        recover(client, lambda _: None)  # type: ignore[arg-type]
    assert client.now_s == pytest.approx(100.0 + TIMEOUT_S, abs=0.1)
