"""Steps of a commissioning with an operator and an axis that are played."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import pytest

from robotd.descriptor import load_robot_descriptor
from robotd.device.bus_status import BusNode
from robotd.errors import NotReady, OperationError
from robotd_canopen import robotd_backend
from robotd_commissioning import steps
from robotd_commissioning.commissioned_axis import CommissionedAxis
from robotd_commissioning.steps import Bench

JOINT = load_robot_descriptor("cr3a").joints[0]
DRIVE = {"axis": 0, "node": 1, "counts_per_rad": 1000.0, "polarity": 1, "identity": None,
         "axis_offset": 0}  # fmt: skip


class PlayedAxis:
    """Stand-in for an axis: a motor with a true position and a scale error."""

    def __init__(self, factor: float = 1.0) -> None:
        self.true, self.factor = 0.0, factor
        self.joint, self.can_home = JOINT, True
        self.objects: dict[tuple[int, int], int] = {}

    def position(self) -> float:
        return self.true * self.factor

    def node(self, number: int) -> BusNode | None:
        return None

    def read_object(self, node: int, index: int, subindex: int) -> int:
        if (index, subindex) not in self.objects:
            raise OperationError("no such object")
        return self.objects[index, subindex]

    def powered(self) -> AbstractContextManager[None]:
        return nullcontext()


class PlayedOperator:
    """Stand-in for the person: answers in order, moves the axis by hand or by a held key."""

    def __init__(self, axis: PlayedAxis, answers: Sequence[Any] = (), move: float = 0.1) -> None:
        self._axis, self._answers, self._move = axis, [*answers], move
        self.said: list[str] = []
        self.homed = False

    def say(self, text: str) -> None:
        self.said.append(text)

    def proceed(self, question: str) -> None:
        self._axis.true += self._move

    def agrees(self, question: str) -> bool:
        return bool(self._answers.pop(0))

    def number(self, question: str) -> float:
        return float(self._answers.pop(0))

    def jog(self, speed: float, distance: float = math.inf) -> float:
        self._axis.true += min(self._move, distance)
        return 0.01 if self._move else 0.0

    def home(self) -> None:
        self.homed = True

    def accepts(self, difference: str) -> bool:
        return True

    def settle(self) -> float:
        return self._move


def bench(
    answers: Sequence[Any] = (), factor: float = 1.0, move: float = 0.1
) -> tuple[Bench, PlayedOperator]:
    keys = robotd_backend().axis_keys
    assert keys is not None
    axis = PlayedAxis(factor)
    operator = PlayedOperator(axis, answers, move)
    return Bench(axis, operator, DRIVE, keys), operator


def test_a_node_that_is_missing_is_named() -> None:
    with pytest.raises(OperationError, match="node 1 is not on the bus"):
        steps.identity(bench()[0])


@pytest.mark.parametrize("answers", [[True], [False, True]], ids=["by hand", "by a jog"])
@pytest.mark.parametrize("factor", [1.0, -1.0])
def test_the_direction_is_found(answers: list[bool], factor: float) -> None:
    finding = steps.direction(bench(answers, factor)[0])
    changes = {change.key: change.value for change in finding.changes}
    assert changes == ({} if factor > 0.0 else {"polarity": -1})


@pytest.mark.parametrize("by_hand", [True, False])
def test_the_scale_is_found(by_hand: bool) -> None:
    finding = steps.scaling(bench([by_hand, math.degrees(0.5)], factor=2.0, move=0.5)[0])
    (change,) = finding.changes
    assert (change.key, change.value) == ("counts_per_rad", pytest.approx(2000.0))


@pytest.mark.parametrize(
    ("factor", "name", "turn"),
    [(1.01, "0x6092", 3600.0), (1165.0, "0x608F x 0x6091", float(1 << 22))],
)
def test_the_motion_tells_which_of_the_stated_scales_counts(
    factor: float, name: str, turn: float
) -> None:
    """The descriptor has another gear; the measured value is off by a part of a percent."""
    at, operator = bench([True, math.degrees(0.5)], factor=factor * 0.5, move=0.5)
    objects = {(0x608F, 1): 1 << 22, (0x608F, 2): 1, (0x6092, 1): 3600, (0x6092, 2): 1}
    cast(PlayedAxis, at.axis).objects = objects
    drive = {**DRIVE, "counts_per_rad": 2 * 3600.0 / math.tau, "axis_offset": 0}
    finding = steps.scaling(replace(at, drive=drive))
    (change,) = finding.changes
    assert change.value == pytest.approx(turn / math.tau)
    assert f"(the drive's {name})" in finding.text
    assert "several counts for a turn: 3600 (0x6092), 4194304 (0x608F x 0x6091)" in operator.said[0]


def test_homing_is_for_the_operator_to_decide() -> None:
    at, operator = bench([True])
    assert steps.homing(at).text.startswith("homed")
    assert operator.homed
    at, operator = bench([False])
    assert "not homed" in steps.homing(at).text
    assert not operator.homed


def test_limits_are_confirmed_or_found() -> None:
    assert "confirmed" in steps.limits(bench([True])[0]).text
    found = steps.limits(bench([False, True, False], move=0.4)[0])
    assert {change.key for change in found.changes} == {"lower_rad", "upper_rad"}


def test_the_following_error_needs_motion() -> None:
    assert steps.following_error(bench()[0]).text
    with pytest.raises(OperationError, match="did not move"):
        steps.following_error(bench(move=0.0)[0])


def test_the_brake_is_judged_by_what_moves_without_the_servo() -> None:
    assert steps.brake(bench(move=0.0)[0]).text


def test_a_servo_off_that_fails_hides_no_error_of_the_step() -> None:
    """The first one says what has happened at the machine."""

    def servo(_: int, on: bool) -> None:
        if not on:
            raise NotReady("servo off was sent and is not confirmed")

    axes: Any = SimpleNamespace(clear_alarm=int, servo=servo, stop_and_wait=lambda *_: None)
    axis = object.__new__(CommissionedAxis)
    axis._robot, axis.number, axis.joint = SimpleNamespace(axes=axes), 0, JOINT  # type: ignore[assignment]
    with pytest.raises(OperationError, match="jammed"), axis.powered():
        raise OperationError("jammed")
    with pytest.raises(NotReady, match="is not confirmed"), axis.powered():
        pass
