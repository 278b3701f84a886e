"""``robotd stop`` whose output nobody reads, and of robots that share a namespace."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from unittest.mock import MagicMock

import pytest
from click.testing import CliRunner

from robotd.cli import main
from robotd_ros.client.stop_request import StopOfAll, StopRequest
from robotd_ros.commands import stop_command
from robotd_testing.domain import own_domain

PROGRESS = "no robot found yet"


class Request:
    """Stop that is confirmed after three tries."""

    progress = PROGRESS
    is_engaged = False

    def __init__(self, client: object) -> None:
        self.tries = 0

    @property
    def is_done(self) -> bool:
        return self.tries == 3

    def advance(self) -> None:
        self.tries += 1

    def result(self) -> str:
        return "stopped, at rest"

    def reaches(self, robots: int) -> bool:
        return True

    def close(self) -> None:
        """Nothing was made."""


def test_a_stop_goes_on_when_its_progress_cannot_be_printed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    @contextmanager
    def robot_client(timeout_s: float, *, searches: bool) -> Iterator[SimpleNamespace]:
        yield SimpleNamespace(spin=lambda: None, wait=lambda condition, *_: condition())

    def warn(text: str) -> None:
        assert PROGRESS in text
        raise BrokenPipeError

    monkeypatch.setattr(stop_command, "robot_client", robot_client)
    monkeypatch.setattr(
        stop_command, "import_ros", lambda name: SimpleNamespace(StopRequest=Request)
    )
    monkeypatch.setattr(stop_command, "print_addressed_robots", lambda client: 1)
    monkeypatch.setattr(stop_command, "FIRST_REPORT_S", 0.0)
    monkeypatch.setattr(stop_command, "warn", warn)
    result = CliRunner().invoke(main, ["stop"])
    assert (result.exit_code, result.stdout) == (0, "stopped, at rest\n")


def test_a_robot_that_is_discovered_after_the_answer_of_another_one_gets_the_stop() -> None:
    """The service reaches those that are discovered when it is called, and one answer ends it."""
    client = MagicMock()
    publisher = client.node.create_publisher.return_value
    publisher.get_subscription_count.return_value = 1
    client.node.create_client.return_value.call_async.return_value.result.return_value = (
        SimpleNamespace(success=True, message="stopped, at rest")
    )
    request = StopRequest(client)
    for _ in range(3):  # the service is made, its call, and the answer
        request.advance()
    assert request.is_done
    assert publisher.publish.call_count == 0
    publisher.get_subscription_count.return_value = 2
    assert request.reaches(2)
    assert publisher.publish.call_count == 1
    assert not request.reaches(3)
    assert publisher.publish.call_count == 1
    request.close()
    assert publisher.wait_for_all_acked.called


def test_it_says_that_it_still_tries_more_rarely_while_nothing_changes(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now_s = [0.0]
    monkeypatch.setattr(stop_command.time, "monotonic", lambda: now_s[0])
    progress = stop_command._Progress(30.0)
    for second in range(31):
        now_s[0] = float(second)
        progress.report(PROGRESS)
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 4  # after 3, 5, 9 and 17 s


def test_the_message_goes_first_and_the_service_is_made_when_it_has_come() -> None:
    client = MagicMock()
    client.listen.return_value.newest = None
    publisher = client.node.create_publisher.return_value
    publisher.get_subscription_count.return_value = 1
    request = StopRequest(client)
    request.advance()
    assert publisher.publish.call_count == 1
    assert not client.node.create_client.called
    client.listen.return_value.newest = SimpleNamespace(data="by a message on the stop topic")
    request.advance()
    assert client.node.create_client.called
    assert publisher.publish.call_count == 1


def test_a_stop_of_all_goes_at_once_to_each_robot_that_is_discovered() -> None:
    client = MagicMock()
    publisher = client.node.create_publisher.return_value
    stop = StopOfAll(client)
    for found, published in ((0, 0), (3, 1), (3, 1), (8, 2), (7, 2), (8, 3)):
        publisher.get_subscription_count.return_value = found
        stop.send(again=False)
        assert publisher.publish.call_count == published


def test_the_way_to_the_first_message_imports_no_numpy() -> None:
    """It would take half of the command's processor time."""
    program = """
import sys
from robotd_ros.client.ros_client import RosClient
from robotd_ros.client.stop_request import StopRequest
client = RosClient()
client.start()
StopRequest(client).advance()
print("numpy" in sys.modules)
client.close()
"""
    with own_domain() as domain:
        run = subprocess.run(
            [sys.executable, "-c", program],
            env=os.environ | {"ROS_DOMAIN_ID": str(domain)},
            capture_output=True,
            text=True,
            check=True,
        )
    assert run.stdout == "False\n"
