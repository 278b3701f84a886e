"""Fixtures: a started robot on the fake bus."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from tests.plugins.ethercat.harness import Harness


@pytest.fixture
def harness(monkeypatch: pytest.MonkeyPatch) -> Iterator[Harness]:
    made = Harness(monkeypatch)
    made.robot.start()
    yield made
    made.robot.shutdown()
