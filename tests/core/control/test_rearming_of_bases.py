"""A client that drives a base on through a stop or a fault moves nothing until it begins anew."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import numpy as np
import pytest
from tests.core.control.base_harness import COMMAND_S, BaseHarness, running

from robotd.control.groups.problem import ProblemKind
from robotd.descriptor import load_robot_descriptor
from robotd.errors import NotReady
from robotd_sim.fault_injector import SimFaultInjector

BASES = ["baymax", "mecanum_base", "tricycle_base", "skid_steer_base"]
SPEED = 0.2


@pytest.fixture(params=BASES)
def harness(request: pytest.FixtureRequest) -> Iterator[BaseHarness]:
    yield from running(load_robot_descriptor(request.param))


def stop(harness: BaseHarness) -> None:
    harness.robot.axes.stop_latch.engage("by the operator")


def trip(harness: BaseHarness) -> None:
    SimFaultInjector(harness.simulation).trip(0, 17)


def switch_on(harness: BaseHarness) -> None:  # as ``robotd recover`` does
    harness.robot.axes.clear_alarm(0)
    harness.step()
    harness.robot.servos.enable()


def lose(harness: BaseHarness) -> None:
    SimFaultInjector(harness.simulation).drop_communication()


def set_inactive(harness: BaseHarness) -> None:  # as ``RobotLifecycle`` does
    harness.robot.axes.stop_latch.inactive = "inactive"
    disabling = threading.Thread(target=harness.robot.servos.disable)
    disabling.start()
    harness.wait(lambda: not disabling.is_alive())


def set_active(harness: BaseHarness) -> None:
    harness.robot.servos.enable()
    harness.robot.axes.stop_latch.inactive = ""


def bring_to_rest(harness: BaseHarness) -> None:  # as after a hang of the thread of ROS
    with driving(harness):
        harness.robot.servos.bring_to_rest()


def disable(harness: BaseHarness) -> None:
    with driving(harness):
        harness.robot.servos.disable()


def switch_all_on(harness: BaseHarness) -> None:  # as ``robotd recover`` does
    for axis in harness.robot.servos.used:
        harness.robot.servos.enable_axis(axis)


State = tuple[Callable[[BaseHarness], None], Callable[[BaseHarness], None]]
STATES: dict[str, State] = {
    "stop": (stop, lambda harness: harness.robot.axes.stop_latch.release(1)),
    "alarm": (trip, switch_on),
    "servo off": (lambda harness: harness.robot.axes.servo(0, False), switch_on),
    "device lost": (lose, lambda harness: harness.up()),
    "inactive": (set_inactive, set_active),
    "brought to rest": (bring_to_rest, lambda harness: None),
    "servos off": (disable, switch_all_on),
}


@contextmanager
def driving(harness: BaseHarness, source: str = "cmd_vel") -> Iterator[set[str]]:
    """Let the client command on in the block, whatever makes time pass; yield its rejections."""
    period, step = round(COMMAND_S / harness.period_s), harness.step
    numbers = itertools.count()
    rejections: set[str] = set()

    def command_and_step() -> None:
        if next(numbers) % period == 0:
            try:
                harness.base.command(SPEED, 0.0, source=source)
            except NotReady as error:
                rejections.add(str(error))
        step()

    harness.clock.step = command_and_step
    yield rejections
    harness.clock.step = step


def drive(harness: BaseHarness, seconds: float, source: str = "cmd_vel") -> tuple[float, set[str]]:
    """Command on for ``seconds``; return the highest speed of a wheel, and the rejections."""
    fastest = 0.0
    with driving(harness, source) as rejections:
        for _ in range(round(seconds / harness.period_s)):
            harness.clock.step()
            harness.settle()
            fastest = max(fastest, float(np.abs(harness.robot.image.velocity).max()))
    return fastest, rejections


def problems(harness: BaseHarness) -> list[str]:
    found = harness.robot.find_problems()
    return [problem.text for problem in found if problem.kind is ProblemKind.SOURCE]


@pytest.mark.parametrize("anew", ["silence", "zero"])
@pytest.mark.parametrize("state", STATES)
def test_nothing_moves_after_a_state_until_the_client_begins_anew(
    harness: BaseHarness, state: str, anew: str
) -> None:
    begin, end = STATES[state]
    moving, _ = drive(harness, 1.5)
    assert moving > 0.5
    begin(harness)
    harness.step()
    drive(harness, 1.5)
    with driving(harness):
        end(harness)
        for _ in range(50):
            harness.clock.step()
    fastest, rejections = drive(harness, 1.0)
    assert fastest < 1e-3
    (text,) = problems(harness)
    assert text.startswith("cmd_vel kept commanding while motion was rejected")
    assert rejections == {text}
    fastest, rejections = drive(harness, COMMAND_S, source="page")  # another client
    assert not rejections
    with suppress(NotReady):
        harness.base.command(0.0, 0.0, source="page")  # its zero twist is nobody else's
    harness.settle()
    harness.run(1.0 if anew == "silence" else COMMAND_S)
    if anew == "zero":
        assert drive(harness, COMMAND_S)[1] == {text}
        harness.base.command(0.0, 0.0, source="cmd_vel")
    fastest, rejections = drive(harness, 1.5)
    assert fastest == pytest.approx(moving, rel=0.05)
    assert not rejections
    assert problems(harness) == []


def test_a_pause_rejects_nothing_and_the_base_goes_on_with_its_ramp(harness: BaseHarness) -> None:
    moving, _ = drive(harness, 1.5)
    harness.robot.pause()
    drive(harness, 1.5)
    assert np.abs(harness.robot.image.velocity).max() < 1e-2
    harness.robot.resume()
    fastest, rejections = drive(harness, 1.5)
    assert fastest == pytest.approx(moving, rel=0.05)
    assert not rejections
