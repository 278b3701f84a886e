"""Whatever clients send: no joint leaves its limits, and what is rejected moves nothing."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterator
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from robotd.clock.simulated import SteppedClock
from robotd.device.process_image import ProcessImage
from robotd.device.state import Operation
from robotd.errors import RobotdError
from robotd.motion import TrajectoryRequest
from robotd.robot import Robot, open_robot
from robotd_ros.nodes import axis_conversions

AXES = 6
ROUNDING = 1e-6
SETTLING = 1e-3  # rad; in velocity mode the command follows an axis that comes to rest
HOSTILE = (math.nan, math.inf, -math.inf, 0.0, -1.0, 1e308, 5e-324)
INDEX = st.lists(st.integers(0, AXES - 1), min_size=1, max_size=AXES, unique=True)
ANY_INDEX = st.one_of(INDEX, INDEX, INDEX, st.lists(st.integers(-1, AXES), max_size=AXES))


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    """Mostly what makes sense and a little more, sometimes what does not."""
    return st.one_of(*[st.floats(1.1 * low, 1.1 * high)] * 8, st.sampled_from(HOSTILE))


TARGETS, SPEEDS, RAMPS = numbers(-3.14, 3.14), numbers(-3.14, 3.14), numbers(1.0, 12.57)


@st.composite
def messages(draw: st.DrawFn, *columns: str) -> Any:
    """An AxisPose or AxisVelocity, by its fields; seldom with columns of other lengths."""
    index = draw(ANY_INDEX)
    values = {"target": TARGETS, "velocity": SPEEDS, "acc": RAMPS, "dec": RAMPS}
    count = len(index) if draw(st.integers(0, 9)) else draw(st.integers(0, AXES))
    fields = {
        name: array("d", draw(st.lists(values[name], min_size=count, max_size=count)))
        for name in columns
    }
    return SimpleNamespace(index=array("i", index), **fields)


@st.composite
def goals(draw: st.DrawFn) -> TrajectoryRequest:
    points = draw(st.integers(1, 4))
    row = st.lists(numbers(-1.0, 1.0), min_size=AXES, max_size=AXES)
    times = np.cumsum(draw(st.lists(st.floats(0.2, 2.0), min_size=points, max_size=points)))
    names = [f"joint{number}" for number in range(1, AXES + 1)]
    rows = draw(st.lists(row, min_size=points, max_size=points))
    return TrajectoryRequest.from_rows(names, times.tolist(), rows)


COMMANDS = st.one_of(
    st.tuples(st.just("jog"), messages("velocity", "acc", "dec")),
    st.tuples(st.just("move"), messages("target", "velocity", "acc", "dec")),
    st.tuples(st.just("move_relative"), messages("target", "velocity", "acc", "dec")),
    st.tuples(st.just("follow"), goals()),
    st.tuples(st.just("mode"), st.tuples(INDEX, st.sampled_from([0, 1]))),
    st.tuples(st.just("wait"), st.integers(1, 500)),
)


@dataclass
class Excess:
    """The farthest that any command of a period was beyond a limit; of all periods."""

    position: float = -math.inf
    velocity: float = -math.inf


@pytest.fixture(scope="module")
def robot() -> Iterator[Robot]:
    with open_robot("cr3a", "sim", clock=SteppedClock()) as robot:
        yield robot


@pytest.fixture(scope="module")
def excess(robot: Robot) -> Excess:
    found = Excess()
    limits = robot.axes.limits
    low, high, fast = np.array([[limit.lower, limit.upper, limit.velocity] for limit in limits]).T
    fast = fast * (1.0 + robot.descriptor.trajectory.velocity_margin)

    def look(image: ProcessImage) -> None:
        position, velocity = image.position_command, image.velocity_command
        found.position = max(found.position, *(low - position), *(position - high))
        found.velocity = max(found.velocity, *(abs(velocity) - fast))

    robot.control_loop.every(robot.descriptor.cycle.rate_hz, "excess", look)
    return found


def do(robot: Robot, name: str, what: Any) -> None:
    match name:
        case "jog":
            robot.axes.jog(axis_conversions.jogs(what))
        case "move" | "move_relative":
            robot.axes.move(axis_conversions.moves(what), relative=name == "move_relative")
        case "follow":
            with robot.follower.follow(what) as execution:
                execution.wait(1.0)
        case "mode":
            for axis in what[0]:
                robot.axes.set_command_mode(axis, what[1])
        case "wait":
            robot.step(what)


def idle(robot: Robot) -> bool:
    return bool((robot.image.operation == Operation.IDLE).all())


@settings(
    suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=40
)
@given(st.lists(COMMANDS, min_size=1, max_size=8))
def test_limits_hold(robot: Robot, excess: Excess, commands: list[tuple[str, Any]]) -> None:
    for name, what in commands:
        robot.step(2)  # the image is behind what was commanded
        before = robot.image.position_command.copy() if idle(robot) else None
        try:
            do(robot, name, what)
        except RobotdError:
            robot.step(3)
            if before is not None:
                assert idle(robot), f"{name} was rejected, and an axis moves"
                assert robot.image.position_command == pytest.approx(before, abs=SETTLING)
    robot.axes.stop_and_wait(range(AXES), 30.0)
    assert excess.position <= ROUNDING
    assert excess.velocity <= ROUNDING


def test_a_velocity_command_is_left_running_for_a_minute(robot: Robot, excess: Excess) -> None:
    robot.axes.stop_and_wait(range(AXES), 30.0)
    for axis in range(AXES):
        robot.axes.set_command_mode(axis, 1)
    for sign in (1.0, -1.0):
        profile = {"velocity": [sign] * AXES, "acc": [5.0] * AXES, "dec": [5.0] * AXES}
        robot.axes.jog(axis_conversions.jogs(SimpleNamespace(index=list(range(AXES)), **profile)))
        robot.step(round(60.0 * robot.descriptor.cycle.rate_hz))
        assert idle(robot)
        ends = [limit.upper if sign > 0 else limit.lower for limit in robot.axes.limits]
        assert robot.image.position == pytest.approx(ends, abs=0.02)
    assert excess.position <= ROUNDING
