"""Output of ``robotd status`` for programs."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from click.testing import CliRunner
from tests.ros.unit.test_status_watch_view import axis

from robotd.cli import main
from robotd_ros.client import status_client
from robotd_ros.client.fleet import read_identity
from robotd_ros.client.status_client import RobotReport
from robotd_ros.commands import status_command


def test_values_that_are_not_known_are_null(monkeypatch: pytest.MonkeyPatch) -> None:
    """A drive that has not answered since the start has no position."""

    @contextmanager
    def robot_client(timeout_s: float) -> Iterator[None]:
        yield None

    unknown = axis(0, position=math.nan)
    report = RobotReport(read_identity("{}"), "", True, 1.0, (), (unknown,), {}, {}, {}, ())
    monkeypatch.setattr(status_command, "robot_client", robot_client)
    monkeypatch.setattr(status_command, "require_one_robot", lambda client, prints: None)
    monkeypatch.setattr(status_client, "read_report", lambda client: report)

    def reject(constant: str) -> Any:
        raise AssertionError(constant)

    output = CliRunner().invoke(main, ["status", "--json"]).stdout
    (shown,) = json.loads(output, parse_constant=reject)["axes"]
    assert (shown["position"], shown["position_command"]) == (None, 0.5)
