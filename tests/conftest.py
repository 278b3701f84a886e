"""Settings of Hypothesis for all tests, and further attempts of those in real time."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import settings

from robotd_conformance.busy_computer import BusyComputer, RealTimeFolders

# No deadlines: a busy computer misses every one. Examples are the same in every run, so that a
# change is judged by itself; ``--hypothesis-profile=explore`` looks for new ones.
settings.register_profile("explore", deadline=None)
settings.register_profile("robotd", settings.get_profile("explore"), derandomize=True)
settings.load_profile("robotd")

REAL_TIME = ("canopen", "conformance", "ethercat", "independent", "page", "ros")


def pytest_configure(config: pytest.Config) -> None:
    target = RealTimeFolders(Path(__file__).parent, REAL_TIME)
    config.pluginmanager.register(BusyComputer(target), "busy-computer")
