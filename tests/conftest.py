"""Settings of Hypothesis, time limits, long tests and order of all tests."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from hypothesis import settings
from tests.time_limits import TimeLimits

# No deadlines: a busy computer misses every one. Examples are the same in every run, so that a
# change is judged by itself; ``--hypothesis-profile=explore`` looks for new ones.
settings.register_profile("explore", deadline=None)
settings.register_profile("robotd", settings.get_profile("explore"), derandomize=True)
settings.load_profile("robotd")

HERE = Path(__file__).parent
REAL_TIME = ("canopen", "conformance", "ethercat", "independent", "page", "ros")
"""Folders of robots, buses and browsers in real time; `make test` runs those marked daily."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--random-order",
        type=int,
        metavar="SEED",
        help="shuffle the files and the tests of each, by SEED: the same seed gives the same order",
    )


def pytest_configure(config: pytest.Config) -> None:
    config.pluginmanager.register(TimeLimits(), "time-limits")


@pytest.hookimpl(tryfirst=True)  # before -m selects
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what is long; shuffle on request, and keep the tests of a file together."""
    for item in items:
        inside = item.path.is_relative_to(HERE)
        is_long = inside and item.path.relative_to(HERE).parts[0] in REAL_TIME
        if is_long and not item.get_closest_marker("daily"):
            item.add_marker("long")
    seed = config.getoption("--random-order")
    if seed is not None:
        order = random.Random(seed)
        order.shuffle(items)
        files = {path: index for index, path in enumerate(dict.fromkeys(i.path for i in items))}
        items.sort(key=lambda item: files[item.path])
