"""Commands of the witness's sequences: how often each comes, and what draws its arguments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from random import Random
from typing import Any

from tests.contract.sequences import Commands, Draw, one_of
from tests.contract.test_any_base_sequence import profile, twist
from tests.contract.test_any_sequence import arm_commands

PERIODS = one_of(1, 2, 5, 20, 60)


def positions(joints: int) -> Any:
    """Return what draws positions about the middles of the joints, or velocities."""
    return lambda random: [random.uniform(-0.9, 0.9) for _ in range(joints)]


CLIENT = one_of("cmd_vel", "cmd_vel", "page")
MOTIONS = ("path", "path", "positions", "velocities", "windows", "jog", "move", "torques")
FAULTS = {"silence": 6, "block": 2, "delay": 1, "reset": 1, "trip": 1, "refuse": 1}
"""How often each comes."""


def fault(joints: int, faults: Mapping[str, float] = FAULTS) -> Any:
    """Return what draws a fault: its name, axes (all: none), periods, displacement, and delay."""

    def draw(random: Random) -> tuple[str, list[int], int, str, int]:
        [name] = random.choices(tuple(faults), tuple(faults.values()))
        axes = random.choice(([], [random.randrange(joints)]))
        periods = round(200 ** random.random())
        how = random.choice(("both", "both", "answers", "commands"))
        return name, axes, periods, how, random.randint(1, 3)

    return draw


def commands(
    joints: int, axes: int, faults: Mapping[str, float] = FAULTS, *, hands: bool = False
) -> Commands:
    """Return the commands of a robot of ``joints``; faults come in the midst of what follows.

    Those of its ``axes`` that are not joints are the wheels of a base. ``hands``: joints are moved
    by hand, too.
    """
    known = dict(arm_commands(joints, positions(joints)))
    for name in ("fault", "fault_later"):
        del known[name]
    known = {
        name: (weight, tuple(PERIODS if draw is _OLD else draw for draw in draws))
        for name, (weight, draws) in known.items()
    }
    seconds = one_of(0.0, 0.02, 0.1, 0.3)
    return known | {
        "window": (3, (positions(joints), PERIODS)),
        "torque": (1, (lambda random: [random.uniform(-6, 6) for _ in range(joints)], PERIODS)),
        "home": (0.5, (one_of(*range(joints)),)),
        "lifecycle": (0.5, (one_of("stop", "start", "close", "open"),)),
        "restart": (0.3, (one_of(False, True),)),
        "disturb": (3, (fault(axes, faults), seconds)),
        "struck": (25, (one_of(*MOTIONS), positions(joints), fault(axes, faults), seconds)),
        "heal": (2, ()),
        **(wheel_commands(range(joints, axes), fault(axes, faults)) if axes > joints else {}),
        **(hand_commands(joints, fault(axes, faults)) if hands else {}),
    }


def wheel_commands(wheels: Sequence[int], disturbance: Draw) -> Commands:
    """Return the commands of a base; half of all are of it."""
    driven = twist, one_of(0.02, 0.1, 0.4), one_of(0.2, 1.0, 3.0), one_of(0.1, 0.5)
    seconds = one_of(0.0, 0.02, 0.1, 0.3, 0.8)
    return {
        "drive": (8, (CLIENT, *driven, PERIODS)),
        "zero": (2, (CLIENT,)),
        "end_drive": (2, (CLIENT,)),
        "driven": (30, (CLIENT, *driven, disturbance, seconds)),
        "wheel_jog": (2, (one_of(*wheels), profile, PERIODS)),
        "wheel_mode": (1, (one_of(*wheels), one_of(0, 1, 1))),
        "wheel_servo": (1, (one_of(*wheels), one_of(False, True, True))),
    }


def hand_commands(joints: int, disturbance: Draw) -> Commands:
    """Return what is done with the hands, with a fault in the midst of some of it."""
    axis, displacements = one_of(*range(joints)), one_of(-0.6, -0.1, 0.1, 0.6)
    seconds = one_of(0.0, 0.1, 0.3, 0.6)
    return {
        "push": (4, (axis, displacements)),
        "moved_off": (8, (axis, displacements, seconds, PERIODS)),
        "guide": (8, (axis, displacements, disturbance, seconds, PERIODS)),
    }


def tool_commands(disturbance: Draw) -> Commands:
    """Return the commands of an arm whose tool is known: half of all are of it."""

    def displacements(random: Random) -> list[list[float]]:
        return [[random.uniform(-0.12, 0.12) for _ in "xyz"] for _ in range(3)]

    seconds, end = one_of(0.1, 0.3, 0.6), one_of("", "", "stop", "cancel", "pause", "slow")
    part = one_of(0.1, 0.3, 0.5, 0.7, 0.9)
    return {
        "sequence": (30, (displacements, part, end, one_of(True, False), disturbance, seconds)),
        "payload": (5, (one_of(0.0, 0.5, 1.0),)),
    }


_OLD = arm_commands(1, positions(1))["step"][1][0]  # its waits are for a faster loop
