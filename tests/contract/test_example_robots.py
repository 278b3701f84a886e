"""Robots with several parts on one device: URDFs as of the parts, and all parts move."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from lxml import etree

from robotd.clock.simulated import SteppedClock
from robotd.control.loop.setpoint_source import Outcome
from robotd.descriptor import load_robot_descriptor
from robotd.device.state import Operation
from robotd.motion import TrajectoryRequest
from robotd.robot import Robot, open_robot

WAIT_S = 60.0
LINKS = ("parent", "child")


def elements(robot: str, prefix: str = "", base: str = "base_link") -> dict[str, str]:
    """XML of the URDF's links and joints by name, without ``prefix``, ``base`` as base_link."""
    path = load_robot_descriptor(robot).urdf
    assert path is not None
    found = {}
    for element in etree.parse(path).getroot().iterchildren("link", "joint"):
        for part in (element, *element.iterchildren(*LINKS)):
            for key in ("name", "link"):
                if (name := part.get(key)) is not None:
                    part.set(key, "base_link" if name == base else name.removeprefix(prefix))
        found[str(element.get("name"))] = etree.tostring(element, with_tail=False).decode()
    return found


def assert_part(part: dict[str, str], whole: dict[str, str], *without: str) -> None:
    names = {name for name in part if not name.startswith(without or ("-",))}
    assert {name: whole.get(name) for name in names} == {name: part[name] for name in names}


def test_the_arms_of_dual_cr3a_are_those_of_cr3a() -> None:
    cr3a = elements("cr3a")
    for side in ("left_", "right_"):
        arm = elements("dual_cr3a", side, f"{side}base_link")
        assert_part(cr3a, arm, "picker")
    limits = [joint.model_dump(exclude={"name", "axis"}) for joint in joints("cr3a")]
    assert [joint.model_dump(exclude={"name", "axis"}) for joint in joints("dual_cr3a")] == [
        *limits,
        *limits,
    ]


def test_the_mobile_manipulator_is_cr3a_on_baymax() -> None:
    assert_part(elements("baymax"), elements("mobile_manipulator"))
    assert_part(elements("cr3a"), elements("mobile_manipulator", base="arm_base_link"))


@pytest.fixture
def manipulator() -> Iterator[Robot]:
    with open_robot("mobile_manipulator", "sim", clock=SteppedClock()) as robot:
        yield robot


def test_arm_and_base_of_the_mobile_manipulator_move_at_the_same_time(manipulator: Robot) -> None:
    base = manipulator.base
    assert base is not None

    def drive(condition: Callable[[], object]) -> None:
        """Step with the base commanded, until ``condition``; a thread claims the wheels."""
        deadline = time.monotonic() + WAIT_S
        while not condition():
            assert time.monotonic() < deadline
            base.command(0.3, 0.1)
            manipulator.step(5)
            time.sleep(5e-4)

    drive(lambda: manipulator.image.operation[6:8].tolist() == [Operation.STREAM] * 2)
    request = TrajectoryRequest.from_rows(manipulator.joint_names, [2.0], [[0.4] * 6])
    with manipulator.follower.follow(request) as execution:
        drive(lambda: execution.done)
    assert execution.outcome is Outcome.SUCCEEDED, execution.message
    assert manipulator.image.position[:6] == pytest.approx([0.4] * 6, abs=0.01)
    assert base.pose.x > 0.1


def joints(robot: str) -> Any:
    return load_robot_descriptor(robot).joints
