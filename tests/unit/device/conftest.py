"""Fixtures of the device tests."""

from __future__ import annotations

import pytest
from tests.unit.device.harness import Harness


@pytest.fixture
def harness() -> Harness:
    """Ready: communicating, servos on, at rest."""
    return Harness().make_ready()
