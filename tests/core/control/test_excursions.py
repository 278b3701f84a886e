"""A joint that leaves its position limits in motion stops it, once, whatever moves it."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from tests.core.control.harness import Harness, arm

from robotd.control.groups.problem import ProblemKind
from robotd.control.loop.setpoint_source import Outcome
from robotd.device.axes import Jog, Move
from robotd.device.state import CommandMode, Operation
from robotd.motion.profile import Profile

NEAR, JUMP = 2.98, 0.2  # rad; the limit is 3, and 0.01 beyond it counts as inside
GENTLE = Profile(0.02, 5.0, 5.0)


@pytest.fixture
def harness() -> Harness:
    """An arm whose first joint is just inside its limit."""
    harness = Harness(arm(trajectory={"path_tolerance_rad": 1.0, "goal_tolerance_rad": 1.0})).up()
    harness.move(0, NEAR)
    harness.until(lambda: bool(harness.image.motion_complete[0]))
    return harness


def leave(harness: Harness) -> None:
    harness.run(0.1)
    harness.faults.jump_encoder(0, JUMP)


def move_outside(harness: Harness) -> None:
    harness.robot.axes.servo(0, False)
    harness.faults.move_by_hand(0, JUMP)
    harness.robot.axes.servo(0, True)


def is_idle(harness: Harness) -> Callable[[], bool]:
    return lambda: bool(harness.image.operation[0] == Operation.IDLE)


def outside(harness: Harness) -> list[str]:
    found = harness.robot.find_problems()
    return [problem.text for problem in found if problem.kind is ProblemKind.OUTSIDE_LIMITS]


def test_problems_that_another_observer_has_found_will_do_for_their_age(harness: Harness) -> None:
    assert outside(harness) == []
    move_outside(harness)
    assert harness.robot.find_problems(3600.0) == []
    assert outside(harness)
    assert harness.robot.find_problems(3600.0)


def test_a_goal_is_stopped(harness: Harness) -> None:
    with harness.goal((NEAR, 1.0, 1.0)) as execution:
        leave(harness)
        harness.end(execution)
    assert execution.outcome is Outcome.STOPPED
    assert "outside its limits -3 to 3 rad" in execution.message
    assert execution.message.startswith("joint1 at ")
    assert harness.image.position[1] < 0.9


def test_the_way_back_is_not_stopped(harness: Harness) -> None:
    move_outside(harness)
    assert len(outside(harness)) == 1
    with harness.goal((0.0, 0.0, 0.0), seconds=3.0) as execution:
        harness.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED, execution.message
    assert outside(harness) == []


def test_a_stream_is_stopped_and_has_to_begin_anew(harness: Harness) -> None:
    with harness.robot.stream() as stream:
        stream.send_velocity([0.0, 0.5, 0.0])
        leave(harness)
        stream.send_velocity([0.0, 0.5, 0.0])
        harness.run(0.1)
        assert not stream.open
        assert "outside its limits" in stream.message


@pytest.mark.parametrize("mode", [CommandMode.POSITION, CommandMode.VELOCITY])
def test_a_command_of_a_single_axis_is_stopped_once(harness: Harness, mode: CommandMode) -> None:
    axes = harness.robot.axes
    axes.set_command_mode(0, mode)
    if mode is CommandMode.POSITION:
        axes.move([Move(0, 2.5, GENTLE)])
    else:
        axes.jog([Jog(0, Profile(-0.02, 5.0, 5.0))])
    leave(harness)
    harness.until(is_idle(harness), 1.0)
    move_outside(harness)
    back = Profile(0.5, 5.0, 5.0)
    if mode is CommandMode.POSITION:
        axes.move([Move(0, 2.5, back)])
    else:
        axes.jog([Jog(0, Profile(-0.5, 5.0, 5.0))])
    harness.run(0.9)
    assert harness.image.position[0] < 2.9
    assert outside(harness) == []


def test_a_joint_that_is_within_the_margin_of_a_measurement_goes_on(harness: Harness) -> None:
    with harness.goal((NEAR, 1.0, 1.0)) as execution:
        harness.run(0.1)
        harness.faults.jump_encoder(0, 0.029)
        harness.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED, execution.message
