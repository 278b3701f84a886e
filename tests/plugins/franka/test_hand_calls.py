"""Calls of the hand into ``franky.Gripper``, on a fake written from libfranka's documentation.

``move`` and ``grasp`` return when the fingers rest; ``stop`` ends them by an exception, and without
one under way releases what is held. ``unanswered`` is franky-sim, which never answers a command
that was stopped.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import franky
import pytest
from tests.ros.robot_process import wait_until

from robotd.api import ConnectError, DeviceTimeout, NotReady, OperationError
from robotd.clock import MonotonicClock
from robotd_franka import hand as module
from robotd_franka.hand import START_S, STILL_M, STILL_S, FrankaHand, HandState, _Standstill
from robotd_franka.options import HandOptions

STROKE_M = 0.08
HOMING_S = 30.0


class FakeGripper:
    """Fingers that rest at once, or never (``slow``) until they are stopped.

    Attributes:
        calls: that have begun, and commands that were stopped.
        slow, slow_to_stop, unanswered: how commands and stops behave.
        is_blocked: homing does not find the ends.
        found: content of the states.
    """

    def __init__(self, address: str = "") -> None:
        self.calls: list[str] = []
        self.found = SimpleNamespace(width=0.04, max_width=STROKE_M, is_grasped=False)
        self.slow = self.unanswered = self.slow_to_stop = self.is_blocked = False
        self._ends, self._stopped = threading.Event(), False
        self._begun: list[threading.Event] = []

    @property
    def state(self) -> SimpleNamespace:
        time.sleep(0.002)
        return self.found

    def move(self, width: float, speed: float) -> bool:
        return self._run(f"move {width:g}", width, grasped=False)

    def grasp(self, width: float, speed: float, force: float, inner: float, outer: float) -> bool:
        assert inner == outer == STROKE_M
        return self._run(f"grasp {width:g} by {force:g}", width, grasped=True)

    def homing(self) -> bool:
        return self._run("homing", STROKE_M, grasped=False) and not self.is_blocked

    def stop(self) -> bool:
        self.calls.append("stop")
        while self.slow_to_stop:
            time.sleep(0.001)
        self._stopped = True
        if not self.unanswered:
            self._ends.set()
        return True

    def release(self) -> None:
        """End all commands."""
        for ends in self._begun:
            ends.set()

    def _run(self, name: str, width: float, *, grasped: bool) -> bool:
        self.calls.append(name)
        ends, self._stopped = threading.Event(), False
        self._begun.append(ends)
        if self.slow:
            self._ends = ends
            ends.wait()
            if self._stopped:
                self.calls.append(f"{name.split(maxsplit=1)[0]} aborted")
                raise franky.CommandException("libfranka gripper: Command aborted!")
        self.found = SimpleNamespace(width=width, max_width=STROKE_M, is_grasped=grasped)
        return True


@pytest.fixture
def gripper(monkeypatch: pytest.MonkeyPatch) -> FakeGripper:
    fake = FakeGripper()
    monkeypatch.setattr(module.franky, "Gripper", lambda address: fake)
    return fake


@pytest.fixture
def hand(gripper: FakeGripper) -> Iterator[FrankaHand]:
    hand = FrankaHand("fr3", HandOptions(), MonotonicClock())
    hand.open("127.0.0.1")
    yield hand
    gripper.slow_to_stop = False
    hand.close()
    gripper.release()


def close(hand: FrankaHand, closed: bool = True) -> None:
    hand.write_output_bit(0, 0, closed)


def move(hand: FrankaHand, width: float, force_n: float = 0.0) -> None:
    hand.move(dict.fromkeys(hand.names, width / 2), force_n)


def called(gripper: FakeGripper, *calls: str) -> None:
    wait_until(lambda: len(gripper.calls) >= len(calls), f"{calls}, not {gripper.calls}")
    assert gripper.calls == list(calls)


def test_connecting_moves_nothing(hand: FrankaHand, gripper: FakeGripper) -> None:
    assert hand.at_rest
    assert gripper.calls == []


def test_a_command_at_rest_stops_nothing(hand: FrankaHand, gripper: FakeGripper) -> None:
    close(hand, False)
    called(gripper, "move 0.08")
    wait_until(lambda: hand.at_rest and hand._state.width == STROKE_M, "the fingers open")
    close(hand)
    called(gripper, "move 0.08", "grasp 0 by 30")


def test_a_new_command_waits_until_the_one_on_its_way_has_stopped(
    hand: FrankaHand, gripper: FakeGripper
) -> None:
    gripper.slow = gripper.slow_to_stop = True
    close(hand)
    called(gripper, "grasp 0 by 30")
    close(hand, False)
    called(gripper, "grasp 0 by 30", "stop")
    assert not hand.at_rest
    gripper.slow_to_stop = False
    called(gripper, "grasp 0 by 30", "stop", "grasp aborted", "move 0.08")
    wait_until(lambda: hand.at_rest, "the new command has begun")


def test_a_stop_ends_the_command_on_its_way_only(hand: FrankaHand, gripper: FakeGripper) -> None:
    hand.stop()
    wait_until(lambda: not hand._asked.is_set(), "the stop is seen")
    assert gripper.calls == []
    gripper.slow = True
    close(hand)
    called(gripper, "grasp 0 by 30")
    hand.stop()
    called(gripper, "grasp 0 by 30", "stop", "grasp aborted")


def test_what_is_held_is_neither_grasped_again_nor_released(
    hand: FrankaHand, gripper: FakeGripper
) -> None:
    move(hand, 0.03, 20.0)
    called(gripper, "grasp 0.03 by 20")
    wait_until(lambda: hand.read_inputs(0, 1) == b"\x01", "a part is held")
    close(hand)
    wait_until(lambda: hand.at_rest, "nothing to do")
    hand.close()
    assert gripper.calls == ["grasp 0.03 by 20"]


@pytest.mark.parametrize(
    ("width", "force_n", "call"),
    [
        (0.03, 0.0, "move 0.03"),
        (0.03, 20.0, "grasp 0.03 by 20"),
        (0.03, 100.0, "grasp 0.03 by 70"),
        (0.06, 20.0, "move 0.06"),
        (0.0, 0.0, "grasp 0 by 30"),
    ],
)
def test_closing_grasps_with_a_force_or_to_the_end(
    hand: FrankaHand, gripper: FakeGripper, width: float, force_n: float, call: str
) -> None:
    move(hand, width, force_n)
    called(gripper, call)


def test_fingers_together_hold_nothing(hand: FrankaHand, gripper: FakeGripper) -> None:
    close(hand)
    wait_until(lambda: hand._state.grasped, "the hand calls it a grasp")
    assert hand.read_inputs(0, 1) == b"\x00"
    assert hand.read_outputs(0, 1) == b"\x01"


def test_a_stopped_command_without_an_answer_is_given_up(
    hand: FrankaHand, gripper: FakeGripper, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "ANSWER_S", 0.05)
    gripper.slow = gripper.unanswered = True
    close(hand)
    called(gripper, "grasp 0 by 30")
    gripper.slow = False
    close(hand, False)
    called(gripper, "grasp 0 by 30", "stop", "move 0.08")


def test_fingers_that_stand_have_moved_before_or_had_time_to_begin() -> None:
    still, now_s = _Standstill(), 0.0

    def stands(width: float, for_s: float) -> bool:
        nonlocal now_s
        for _ in range(50):
            now_s += for_s / 50
            still.note(HandState(round(now_s * 1e9), width, STROKE_M, grasped=False))
        return still.long

    assert not stands(0.04, START_S - 0.5)  # a busy computer has not sent the command yet
    assert stands(0.04, 1.0)
    still.begin()
    assert not stands(0.04, 1.0)
    assert not stands(0.03, STILL_S - 0.1)
    assert stands(0.03, 0.2)
    still.note(HandState(round((now_s + 1.0) * 1e9), 0.03 - 2 * STILL_M, STROKE_M, grasped=False))
    assert not still.long


def test_a_hand_without_a_stroke_is_not_moved(hand: FrankaHand, gripper: FakeGripper) -> None:
    gripper.found = SimpleNamespace(width=0.0, max_width=0.0, is_grasped=False)
    wait_until(lambda: hand._state.max_width == 0.0, "the state")
    with pytest.raises(NotReady, match="not homed: robotd gripper home"):
        close(hand)
    hand.home(HOMING_S)
    close(hand)
    called(gripper, "homing", "grasp 0 by 30")


def test_homing_is_over_when_the_hand_has_its_stroke(
    hand: FrankaHand, gripper: FakeGripper
) -> None:
    close(hand)
    called(gripper, "grasp 0 by 30")
    wait_until(lambda: hand.at_rest and hand._state.width == 0.0, "the fingers close")
    hand.home(HOMING_S)
    assert hand.at_rest
    assert hand.read_outputs(0, 1) == b"\x00"  # it rests open


def test_homing_that_fails_or_drops_a_part_is_an_error(
    hand: FrankaHand, gripper: FakeGripper
) -> None:
    gripper.is_blocked = True
    with pytest.raises(OperationError, match="the hand was not homed: the hand has not done it"):
        hand.home(HOMING_S)
    move(hand, 0.03, 20.0)
    wait_until(lambda: hand.read_inputs(0, 1) == b"\x01", "a part is held")
    with pytest.raises(NotReady, match="holds a part"):
        hand.home(HOMING_S)
    assert gripper.calls == ["homing", "grasp 0.03 by 20"]


@pytest.mark.parametrize("end", ["stop", "command", "time"])
def test_homing_ends_by_a_stop_a_command_and_its_time(
    hand: FrankaHand, gripper: FakeGripper, end: str
) -> None:
    gripper.slow = True
    with ThreadPoolExecutor() as pool:
        homing = pool.submit(hand.home, 0.3 if end == "time" else HOMING_S)
        wait_until(lambda: gripper.calls == ["homing"], "it homes")
        if end == "stop":
            hand.stop()
        elif end == "command":
            close(hand)
        with pytest.raises((OperationError, DeviceTimeout), match=r"stopped, or|waited 0\.3 s"):
            homing.result()
    wait_until(lambda: gripper.calls[:3] == ["homing", "stop", "homing aborted"], "it stops")


def test_fingers_that_turn_back_while_they_are_homed_are_not_at_rest(
    hand: FrankaHand, gripper: FakeGripper
) -> None:
    gripper.slow = True
    with ThreadPoolExecutor() as pool:
        homing = pool.submit(hand.home, HOMING_S)
        wait_until(lambda: hand._still.long, "they stand for long", START_S + 10.0)
        assert not hand.at_rest
        gripper.release()
        homing.result()
    assert hand.at_rest


def test_a_hand_that_does_not_answer_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(address: str) -> None:
        raise franky.NetworkException("Connection refused")

    monkeypatch.setattr(module.franky, "Gripper", refuse)
    hand = FrankaHand("fr3", HandOptions(), MonotonicClock())
    with pytest.raises(ConnectError, match=r"Connection refused.*--variant hand"):
        hand.open("127.0.0.1")
    with pytest.raises(NotReady, match="not connected"):
        close(hand)
