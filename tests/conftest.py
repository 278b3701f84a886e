"""Settings of Hypothesis, time limits, long tests and order of all tests."""

from __future__ import annotations

import random
import signal
from collections import Counter
from pathlib import Path
from zlib import crc32

import pytest
from hypothesis import settings
from tests.time_limits import TimeLimits

# No deadlines: a busy computer misses every one. Examples are the same in every run, so that a
# change is judged by itself; ``--hypothesis-profile=explore`` looks for new ones.
settings.register_profile("explore", deadline=None)
settings.register_profile("robotd", settings.get_profile("explore"), derandomize=True)
settings.load_profile("robotd")

# Tests send these, and programs inherit that they are ignored: by `nohup`, or by a script's `&`.
for number, handler in (
    (signal.SIGINT, signal.default_int_handler),
    (signal.SIGQUIT, signal.SIG_DFL),
    (signal.SIGHUP, signal.SIG_DFL),
):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, handler)

HERE = Path(__file__).parent
REAL_TIME = (
    "features/conformance/runs",
    "features/foxglove",
    "features/page/server",
    "plugins/canopen/bus",
    "plugins/ethercat/bus",
    "plugins/independent",
    "ros",
)
"""Folders of robots, buses and browsers in real time; `make test` runs those marked daily.

It is a test's own folder that counts: `ros/unit` is not among them."""

PROCESSES = (
    "contract/test_ament_prefix.py",
    "features/inventory/test_dying_plugins.py",
    "features/new_robot/test_robot_package.py",
    "plugins/dobot/test_conformance.py",
    "plugins/dynamixel/test_conformance.py",
    "plugins/feetech/test_conformance.py",
)
"""Files elsewhere that are long as a whole: each test starts processes that take seconds."""

SLOWEST = (
    "features/conformance/runs/test_mutants.py",
    "features/conformance/runs/test_other_mutants.py",
    "features/conformance/runs/test_backends.py",
    "plugins/canopen/bus/test_conformance.py",
    "plugins/feetech/test_conformance.py",
    "plugins/dynamixel/test_conformance.py",
    "plugins/dobot/test_conformance.py",
    "features/page/server/test_layout_in_browser.py",
    "ros/test_cut_link.py",
    "features/conformance/runs/test_new_backend.py",
)
"""Files of minutes, which begin first: a worker that began one in the end would work on alone."""

TURNS = 5  # runs of the gate that have all long tests between them

pytest_plugins = ["tests.command_line", "tests.installed_plugin"]


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--random-order",
        type=int,
        metavar="SEED",
        help="shuffle the files and the tests of each, by SEED: the same seed gives the same order",
    )
    parser.addoption("--units", action="store_true", help="leave out the folders in real time")
    parser.addoption(
        "--turn",
        type=int,
        metavar="NUMBER",
        help=f"of the long tests of each file, one in {TURNS}: another one for the next NUMBER",
    )


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """With ``--units`` leave out the tests of robots, buses and browsers."""
    left_out = config.getoption("--units") and collection_path.is_file()
    return True if left_out and is_in_real_time(collection_path) else None


def is_in_real_time(test: Path) -> bool:
    """Return whether the tests of a file run robots, buses or browsers in real time."""
    return test.is_relative_to(HERE) and str(test.parent.relative_to(HERE)) in REAL_TIME


def pytest_configure(config: pytest.Config) -> None:
    config.pluginmanager.register(TimeLimits(), "time-limits")


@pytest.hookimpl(tryfirst=True)  # before -m selects
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what is long; shuffle on request, and keep the tests of a file together."""
    first = {HERE / name: place for place, name in enumerate(SLOWEST)}
    items.sort(key=lambda item: first.get(item.path, len(SLOWEST)))
    processes = {HERE / name for name in PROCESSES}
    for item in items:
        in_real_time = is_in_real_time(item.path) and not item.get_closest_marker("daily")
        if in_real_time or item.path in processes:
            item.add_marker("long")
    if (turn := config.getoption("--turn")) is not None:
        others = set(not_in_turn(turn, items))
        config.hook.pytest_deselected(items=list(others))
        items[:] = [item for item in items if item not in others]
    seed = config.getoption("--random-order")
    if seed is not None:
        order = random.Random(seed)
        order.shuffle(items)
        files = {path: index for index, path in enumerate(dict.fromkeys(i.path for i in items))}
        items.sort(key=lambda item: files[item.path])


def not_in_turn(turn: int, items: list[pytest.Item]) -> list[pytest.Item]:
    """Return the long tests whose turn it is not: one in ``TURNS`` of each file has it."""
    places, others = Counter[Path](), list[pytest.Item]()
    for item in items:
        if item.get_closest_marker("long"):
            places[item.path] += 1
            first = crc32(item.path.name.encode())  # a file of one test is not always in turn 0
            if (first + places[item.path] - turn) % TURNS:
                others.append(item)
    return others
