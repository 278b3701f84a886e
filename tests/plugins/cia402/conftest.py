"""A drive without a bus, with its servo on."""

from __future__ import annotations

import pytest
from tests.plugins.cia402.looped_drive import LoopedDrive


@pytest.fixture
def on() -> LoopedDrive:
    """A drive with its servo on, at rest."""
    made = LoopedDrive()
    made.commands.enable(1.0)
    return made
