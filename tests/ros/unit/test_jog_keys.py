"""Dead-man switch of the keyboard jog, on a clock of the test."""

from __future__ import annotations

import io
import os
import pty
import termios

import pytest
from rich.console import Console

from robotd_ros.client.jog_client import JogState
from robotd_ros.commands.jog_keys import HOLD_S, JogKeys, KeyInput
from robotd_ros.commands.keyboard_jog import jog_view

RIGHT, LEFT = b"\x1b[C", b"\x1bOD"
TICK_S = 0.02


def pressed(data: bytes, **arguments: float) -> JogKeys:
    """Keys of which ``data`` were typed at 0 s."""
    keys = JogKeys(3, **{"speed": 0.1} | arguments)
    keys.feed(b"", -TICK_S)
    keys.feed(data, 0.0)
    return keys


@pytest.mark.parametrize(
    ("key", "velocity"), [(RIGHT, 0.1), (LEFT, -0.1), (b"l", 0.1), (b"h", -0.1)]
)
def test_a_direction_key_moves_for_the_hold_time(key: bytes, velocity: float) -> None:
    keys = pressed(key)
    assert keys.velocity(0.0) == keys.velocity(HOLD_S - 0.001) == velocity
    assert keys.velocity(HOLD_S) == 0.0


def test_repetitions_prolong_the_motion_and_their_end_stops_it() -> None:
    keys, now_s = pressed(RIGHT), 0.0
    for _ in range(50):
        now_s += 0.04
        keys.feed(RIGHT, now_s)
        assert keys.velocity(now_s) == 0.1
    while keys.velocity(now_s):
        now_s += TICK_S
        keys.feed(b"", now_s)
    assert now_s == pytest.approx(2.0 + HOLD_S, abs=TICK_S)


@pytest.mark.parametrize("key", [b" ", b"x", b"2", b"+", b"\x1b[A", b"\x1b[3~"])
def test_any_other_key_stops_at_once(key: bytes) -> None:
    keys = pressed(RIGHT)
    keys.feed(key, 0.01)
    assert keys.velocity(0.01) == 0.0


def test_what_was_typed_during_a_stall_of_the_program_moves_nothing() -> None:
    keys = pressed(RIGHT)
    keys.feed(RIGHT * 20, 1.0)
    assert keys.velocity(1.0) == 0.0
    keys.feed(RIGHT, 1.0 + TICK_S)
    assert keys.velocity(1.0 + TICK_S) == 0.1


def test_what_was_typed_before_the_start_moves_nothing() -> None:
    keys = JogKeys(3, 0.1)
    keys.feed(RIGHT, 5.0)
    assert keys.velocity(5.0) == 0.0


def test_an_arrow_may_come_in_pieces() -> None:
    keys = pressed(b"\x1b")
    assert keys.velocity(0.0) == 0.0
    keys.feed(b"[", TICK_S)
    keys.feed(b"D", 2 * TICK_S)
    assert keys.velocity(2 * TICK_S) == -0.1


def test_numbers_choose_a_joint_that_exists() -> None:
    keys = pressed(b"3")
    assert keys.joint == 2
    for other in (b"4", b"0"):
        keys.feed(other, TICK_S)
        assert keys.joint == 2


def test_plus_and_minus_change_the_speed_between_its_ends() -> None:
    keys = pressed(b"++")
    assert keys.speed == 0.5
    keys.feed(b"+" * 9, TICK_S)
    assert keys.speed == 1.0
    keys.feed(b"-" * 20, TICK_S)
    assert keys.speed == 0.005
    assert pressed(b"+", speed=0.03).speed == 0.05
    assert pressed(b"-", speed=0.03).speed == 0.02


@pytest.mark.parametrize("key", [b"q", b"Q", b"\x04"])
def test_q_ends(key: bytes) -> None:
    assert pressed(key).ended
    assert not pressed(RIGHT).ended


def test_keys_of_a_terminal_come_without_a_line_and_its_loss_is_noticed() -> None:
    master, slave = pty.openpty()
    before = termios.tcgetattr(slave)
    with KeyInput(slave) as keys:
        assert keys.read() == b""
        os.write(master, b"q")
        while not (data := keys.read()):
            pass
        assert (data, keys.lost) == (b"q", False)
    assert termios.tcgetattr(slave) == before
    with KeyInput(slave) as keys:
        os.close(master)
        assert keys.read() == b""
        assert keys.lost
    os.close(slave)


def test_the_view_names_the_joint_and_why_nothing_moves() -> None:
    stream = io.StringIO()
    Console(file=stream, width=100).print(
        jog_view(JogState(None, "motion is stopped: x"), JogKeys(1, 0.1))
    )
    assert "speed 0.1" in stream.getvalue()
    assert "motion is stopped: x" in stream.getvalue()
