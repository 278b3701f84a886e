"""No control period lets NumPy compare with a member of an enum.

It looks for its protocols on the class then, and Python 3.11 answers each by an exception: 8 to 14
µs for one comparison, where an int takes 1. Six axes took 150 of 200 µs of a period.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.features.doors.doors import GUARDED

from robotd import Robot, open_robot
from robotd.api import Operation
from robotd.api.robots import SteppedClock, TrajectoryRequest

pytestmark = pytest.mark.skipif(
    "__getattr__" not in vars(enum.EnumType), reason="members are attributes of the class here"
)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Enums that were compared, by one of the protocols that NumPy looks for."""
    names: list[str] = []
    answer = vars(enum.EnumType)["__getattr__"]

    def noted(cls: enum.EnumType, name: str) -> Any:
        if name == "__array_ufunc__":
            names.append(cls.__name__)
        return answer(cls, name)

    monkeypatch.setattr(enum.EnumType, "__getattr__", noted)
    return names


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Robot]:
    """An arm with all guards."""
    file = tmp_path / "robot.yaml"
    file.write_text(GUARDED, encoding="utf-8")
    with open_robot(file, "sim", clock=SteppedClock()) as robot:
        robot.step(200)
        yield robot


@contextmanager
def rest(robot: Robot) -> Iterator[None]:
    yield


@contextmanager
def stopped(robot: Robot) -> Iterator[None]:
    robot.stop("a test")
    yield


@contextmanager
def stream(robot: Robot) -> Iterator[None]:
    here = robot.image.position[:6].copy()
    with robot.stream() as stream:
        stream.send(here + 0.5)
        robot.step(50)
        yield


@contextmanager
def goal(robot: Robot) -> Iterator[None]:
    here = robot.image.position[:6].copy()
    request = TrajectoryRequest(robot.joint_names, np.array([2.0]), (here + 0.2)[None])
    with robot.follower.follow(request):
        robot.step(50)
        yield


@pytest.mark.parametrize("motion", [rest, stopped, stream, goal])
def test_no_period_compares_with_an_enum(
    robot: Robot, motion: Callable[[Robot], AbstractContextManager[None]], asked: list[str]
) -> None:
    with motion(robot):
        asked.clear()
        robot.step(50)
        assert not asked


def test_the_comparison_would_be_seen(robot: Robot, asked: list[str]) -> None:
    assert (robot.image.operation == Operation.IDLE).any()
    assert asked
