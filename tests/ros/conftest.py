"""What every test of the ROS nodes needs."""

from __future__ import annotations

import warnings

# The first message type to be used imports an old lark, which imports deprecated modules.
# Imported here, it cannot turn the first test into an error.
with warnings.catch_warnings():
    warnings.simplefilter("ignore", DeprecationWarning)
    import rosidl_generator_py  # noqa: F401

from collections.abc import Iterator

import pytest
from tests.ros.robot_process import Client, RobotProcess


@pytest.fixture(scope="session")
def cr3a() -> Iterator[RobotProcess]:
    """The arm with all its nodes, shared: tests leave it at rest, servos on, gripper open."""
    with RobotProcess() as process:
        process.wait_ready()
        yield process


@pytest.fixture(scope="module")
def client(cr3a: RobotProcess) -> Iterator[Client]:
    client = Client(cr3a.domain)
    client.wait_engine()
    yield client
    client.close()
