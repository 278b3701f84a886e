"""Fixtures of the device tests."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.core.device.harness import Harness
from tests.fakes import FakeDevice


@pytest.fixture
def harness() -> Harness:
    """Ready: communicating, servos on, at rest."""
    return Harness().make_ready()


@pytest.fixture
def device() -> FakeDevice:
    """Idle."""
    return FakeDevice()


@pytest.fixture
def parameters(tmp_path: Path) -> Path:
    """A file that a ``FakeDevice`` takes."""
    path = tmp_path / "parameters.xml"
    path.write_text("<Parameters/>", encoding="utf-8")
    return path
