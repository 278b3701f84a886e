"""Text of commands in the event log."""

from __future__ import annotations

import pytest

from robotd.command_text import command_text
from robotd.device.axes import Jog, Move
from robotd.motion.profile import Profile

PROFILE = Profile(0.5, 1.0, 1.0)


@pytest.mark.parametrize(
    ("command", "parameters", "values", "text"),
    [
        ("servo", ["axis", "on"], (1, True), "servo: joint2, on"),
        ("clear_alarm", ["axis"], (7,), "clear alarm: axis 7"),
        ("stop", ["axes"], (range(2),), "stop: joint1, joint2"),
        ("move", ["moves"], ([Move(0, 0.5, PROFILE)],), "move: joint1 to +0.5000"),
        ("jog", ["jogs"], ([Jog(1, PROFILE)],), "jog: joint2 at +0.5000/s"),
        ("jog", ["joint", "velocity", "step"], ("joint1", 0.1, None), "jog: joint1, velocity 0.1"),
        (
            "set_output_bit",
            ["byte", "bit", "value"],
            (0, 3, False),
            "set output bit: byte 0, bit 3, value off",
        ),
        ("set_output_bytes", ["byte", "data"], (2, b"\xff"), "set output bytes: byte 2, data 0xff"),
        ("reset", [], (), "reset"),
    ],
)
def test_a_command_is_stated_with_the_names_of_its_axes(
    command: str, parameters: list[str], values: tuple[object, ...], text: str
) -> None:
    assert command_text(command, parameters, values, ("joint1", "joint2")) == text
