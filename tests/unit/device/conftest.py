"""Fixtures of the device tests."""

from __future__ import annotations

import pytest
from tests.unit.device.rig import Rig


@pytest.fixture
def rig() -> Rig:
    """Ready: communicating, servos on, at rest."""
    return Rig().make_ready()
