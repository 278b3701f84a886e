"""``robotd record`` and the signals that end it."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from click.testing import CliRunner

from robotd.cli import main
from robotd_recorder import record_command


class Client:
    """Client of a robot, which gets SIGINT during the call that starts or stops a recording.

    Attributes:
        calls: what the robot was asked for.
    """

    def __init__(self, interrupted: bool) -> None:
        self.calls: list[bool] = []
        self.node = self
        self._interrupted = interrupted

    def resolve_service_name(self, name: str) -> str:
        return name

    def wait(self, condition: object, what: str) -> None:
        """The robot has been discovered."""

    def count_services(self, name: str) -> int:
        return 1

    def switch(self, name: str, on: bool) -> str:
        if on is self._interrupted:
            os.kill(os.getpid(), signal.SIGINT)
        self.calls.append(on)
        return "recording" if on else "saved"


@pytest.mark.parametrize("interrupted", [True, False])
def test_a_recording_that_was_started_is_stopped_at_any_signal(
    monkeypatch: pytest.MonkeyPatch, interrupted: bool
) -> None:
    client = Client(interrupted)

    @contextmanager
    def robot_client(timeout_s: float) -> Iterator[Client]:
        yield client

    monkeypatch.setattr(record_command, "robot_client", robot_client)
    monkeypatch.setattr(record_command, "require_one_robot", lambda client: None)
    result = CliRunner().invoke(main, ["record", "--time", "0.1"])
    assert (client.calls, result.exit_code) == ([True, False], 0), result.output
    assert "saved" in result.output
