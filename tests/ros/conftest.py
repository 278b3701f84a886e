"""Fixtures of the tests over ROS."""

from __future__ import annotations

import warnings

# The first message type to be used imports an old lark, which imports deprecated modules.
# Imported here, it cannot turn the first test into an error.
with warnings.catch_warnings():
    warnings.simplefilter("ignore", DeprecationWarning)
    import rosidl_generator_py  # noqa: F401

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.ros.robot_process import Client, RobotProcess, connected

os.environ.setdefault("ROBOTD_TIMEOUT", "30")  # commands wait for robots on a busy computer
OUTPUT_CHARS = 6000  # the newest of a robot's output, in the report of a failed test


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line(
        "markers", "second_backend: worth running on another backend than the simulation"
    )


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests with the shared arm come last: it lives until the end, and beside no other robot."""
    items.sort(key=lambda item: "cr3a" in getattr(item, "fixturenames", ()))


def pytest_sessionfinish() -> None:
    """Remove the shared memory of WMX engines, which outlives them."""
    for memory in Path("/dev/shm").glob(f"robotd-test-{os.getpid()}-*"):
        memory.unlink()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    """Add what the running robots have printed to the report of a failed test."""
    report: Any = yield
    if report.failed:
        for number, process in enumerate(RobotProcess.running):
            report.sections.append((f"output of robot {number}", process.output[-OUTPUT_CHARS:]))
    return report


@pytest.fixture(scope="session")
def cr3a() -> Iterator[RobotProcess]:
    """Shared arm with all its nodes; tests leave it at rest, servos on, gripper open."""
    with RobotProcess(simulated_time=True) as process:
        process.wait_ready()
        yield process


@pytest.fixture(scope="module")
def client(cr3a: RobotProcess) -> Iterator[Client]:
    with connected(cr3a) as client:
        yield client
