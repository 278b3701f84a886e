"""``robotd stop`` whose output nobody reads, and of robots that share a namespace."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from unittest.mock import MagicMock

import pytest
from click.testing import CliRunner

from robotd.cli import main
from robotd_ros.client.stop_request import StopRequest
from robotd_ros.commands import stop_command

PROGRESS = "no robot found yet"


class Request:
    """Stop that is confirmed after three tries."""

    progress = PROGRESS

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
    for _ in range(2):  # the call, and its answer
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
