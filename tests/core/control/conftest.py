"""Fixtures of the control tests."""

from __future__ import annotations

import pytest
from tests.core.control.harness import Harness


@pytest.fixture
def harness() -> Harness:
    """Ready, at rest at 0."""
    return Harness().up()
