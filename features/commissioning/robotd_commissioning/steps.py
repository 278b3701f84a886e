"""Steps of a commissioning, each from questions and measurements to a finding."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

from robotd.api import AxisKeys, OperationError
from robotd_commissioning.commissioned_axis import CommissionedAxis
from robotd_commissioning.findings import (
    StepFinding,
    in_words,
    judge_brake,
    judge_direction,
    judge_following_error,
    judge_identity,
    judge_limits,
    judge_scale,
)

JOG = {"rad": math.radians(1.0), "m": 1e-3}
SLOW = {"rad": 0.02, "m": 2e-3}  # rad/s or m/s
FASTER = {"rad": 0.1, "m": 0.01}
SPEED_UNIT = {"rad": "°", "m": "mm"}


class Operator(Protocol):
    """Person at the machine; ``CommissionTerminal``."""

    def say(self, text: str) -> None:
        """Show a paragraph."""

    def proceed(self, question: str) -> None:
        """Wait until the operator has done something."""

    def agrees(self, question: str) -> bool:
        """Ask for yes or no."""

    def number(self, question: str) -> float:
        """Ask for a finite number."""

    def jog(self, speed: float, distance: float = math.inf) -> float:
        """Move while an arrow key is held, until the operator ends it.

        Returns the lag in s, see ``judge_following_error``. The servo is on meanwhile only.
        ``distance`` limits the travel in either direction.
        """

    def home(self) -> None:
        """Home while a key is held; its release stops. Raises OperationError."""

    def accepts(self, difference: str) -> bool:
        """Show a unified diff of the robot's file; ask for permission to write."""

    def settle(self) -> float:
        """Switch the servo on, then off; return the motion afterwards, rad or m."""


@dataclass(frozen=True)
class Bench:
    """One axis, the person beside it, and what the descriptor says of its drive.

    Attributes:
        axis: to be commissioned.
        operator: the person.
        drive: item of the backend's section.
        keys: of ``drive``.
    """

    axis: CommissionedAxis
    operator: Operator
    drive: Mapping[str, Any]
    keys: AxisKeys

    @property
    def unit(self) -> str:
        """``rad`` or ``m``."""
        return self.axis.joint.unit

    def stated_scales(self) -> Mapping[str, float]:
        """Return counts per turn that the drive states, by their objects; empty if linear."""
        stated = self.keys.stated_scales
        if stated is None or self.unit != "rad":
            return {}
        read = partial(self.axis.read_object, int(self.drive[self.keys.node]))
        return stated(read, self.drive)

    def moved(self, question: str) -> float:
        """Return the change of the position while the operator does what ``question`` says."""
        start = self.axis.position()
        self.operator.proceed(question)
        return self.axis.position() - start


def identity(bench: Bench) -> StepFinding:
    """Compare the identity of the drive."""
    number = int(bench.drive[bench.keys.node])
    node = bench.axis.node(number)
    if node is None:
        raise OperationError(f"node {number} is not on the bus")
    return judge_identity(node, bench.drive.get(bench.keys.identity) or {}, bench.keys.identity)


def direction(bench: Bench) -> StepFinding:
    """Find the direction by hand, or by a jog of 1° (1 mm)."""
    operator, name = bench.operator, bench.axis.joint.name
    polarity = int(bench.drive.get(bench.keys.polarity, 1))
    if operator.agrees(f"Can {name} be moved by hand (servo off, brake released)?"):
        reported = bench.moved(f"Move {name} by hand in its POSITIVE direction, by a few degrees")
        positive = True
    else:
        operator.say(
            f"Jog of {in_words(JOG[bench.unit], bench.unit)} at most: hold → until it stops."
        )
        start = bench.axis.position()
        operator.jog(SLOW[bench.unit], JOG[bench.unit])
        reported = bench.axis.position() - start
        positive = operator.agrees("Did the joint move in its POSITIVE direction?")
    return judge_direction(
        reported,
        positive=positive,
        polarity=polarity,
        key=bench.keys.polarity,
        unit=bench.unit,
    )


def scaling(bench: Bench) -> StepFinding:
    """Find the counts per rad (or m) by a known motion."""
    operator, joint, unit = bench.operator, bench.axis.joint, bench.unit
    stated = bench.stated_scales()
    if len(set(stated.values())) > 1:
        texts = [f"{scale:.10g} ({name})" for name, scale in stated.items()]
        operator.say(
            f"The drive states several counts for a turn: {', '.join(texts)}. Manufacturers differ"
            " in which objects count; the motion will tell."
        )
    start = bench.axis.position()
    if operator.agrees(f"Can {joint.name} be moved by hand?"):
        operator.proceed(f"Move {joint.name} by a known amount, the more the better")
    else:
        operator.say("Hold → or ← to move by a known amount, the more the better.")
        operator.jog(FASTER[unit])
    reported = bench.axis.position() - start
    true = operator.number(f"How far did it move, with its sign ({SPEED_UNIT[unit]})?")
    true = math.radians(true) if unit == "rad" else true / 1e3
    scale = float(bench.drive[bench.keys.scale])
    return judge_scale(reported, true, scale, bench.keys.scale, unit, stated)


def homing(bench: Bench) -> StepFinding:
    """Home the axis while a key is held."""
    if not bench.axis.can_home:
        return StepFinding("the backend has no homing: the zero of the encoder counts")
    if not bench.operator.agrees("Home the axis now (it may search a switch)?"):
        return StepFinding("not homed: the zero of the encoder counts")
    bench.operator.home()
    return StepFinding(f"homed, position {in_words(bench.axis.position(), bench.unit)}")


def limits(bench: Bench) -> StepFinding:
    """Find the ends of the free travel."""
    joint, operator = bench.axis.joint, bench.operator
    if joint.type == "continuous":
        return StepFinding("a continuous joint has no limits")
    travel = f"{in_words(joint.lower, joint.unit)} to {in_words(joint.upper, joint.unit)}"
    if operator.agrees(f"Are the limits {travel} known to be right?"):
        return StepFinding(f"limits {travel}, confirmed by the operator")
    ends = []
    for which in ("LOWER", "UPPER"):
        operator.say(f"Move to the {which} end of the free travel, with a margin to the stop.")
        if operator.agrees("Move it by hand?"):
            operator.proceed("Move it there")
        else:
            operator.jog(FASTER[joint.unit])
        ends.append(bench.axis.position())
    return judge_limits(ends[0], ends[1], joint)


def following_error(bench: Bench) -> StepFinding:
    """Measure the lag of the axis in motion."""
    bench.operator.say("Hold → and ← in turn, some degrees each; + and - change the speed.")
    lag_s = bench.operator.jog(FASTER[bench.unit])
    if not lag_s:
        raise OperationError("the axis did not move")
    scale = float(bench.drive[bench.keys.scale])
    return judge_following_error(lag_s, bench.axis.joint, scale, bench.keys.window_object)


def brake(bench: Bench) -> StepFinding:
    """Measure how far the axis moves when its servo goes off."""
    bench.operator.proceed("The servo is switched on, then off. Support the load")
    return judge_brake(bench.operator.settle(), bench.unit)


STEPS: Mapping[str, Callable[[Bench], StepFinding]] = {
    "identity": identity,
    "direction": direction,
    "scaling": scaling,
    "homing": homing,
    "limits": limits,
    "following error": following_error,
    "brake": brake,
}
"""Steps in their order: positions mean something after direction, scale and homing only."""
