"""Binding of a page's command to the state of the robot that the page showed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from robotd.api import NANOSECONDS
from robotd.api.features import OWN_PROCESS, Event, EventKind, Level
from robotd.api.robots import PacedClock, Robot

if TYPE_CHECKING:  # a page that only reads does without the commands
    from robotd_page.control_commands import Seen

MAX_AGE_S = 2.0
ADVICE = "look, and press again"


def reduces_motion(event: Event) -> bool:
    """Return True for a stop, a fault, another speed, servos off, a lost device.

    A command that was given before and comes after must not undo it.
    """
    match event.kind:
        case EventKind.STOP:
            return event.data.get("outcome") != "reset"
        case EventKind.FAULT:
            return True
        case EventKind.COMMAND if event.subject == "servo":
            values = (*event.data["args"][1:], *event.data.get("options", {}).values())
            return event.data["outcome"] == "accepted" and False in values
        case EventKind.STATE:
            is_lost = event.subject == "device" and event.level is Level.WARNING
            return is_lost or event.subject == "speed"
    return False


def rejection(robot: Robot, seen: Seen | None, sender: str) -> str:
    """Return why a command of ``sender`` came too late; "" where it is in time.

    No clock but the robot's own counts.

    Args:
        seen: state for which the command was given.
        sender: whose own commands it has followed.
    """
    if seen is None:
        return "the command does not say which state its page showed: load the page again"
    events, _ = robot.events.since(min(seen.events, robot.events.added))
    for event in reversed(events):
        if reduces_motion(event) and event.sender != sender:
            by = f" ({event.sender})" if event.sender not in ("", OWN_PROCESS) else ""
            return f"{event.text}{by}, after what this page showed: {ADVICE}"
    if (age_s := _age_s(robot, seen.time_s)) > MAX_AGE_S:
        return (
            f"this page showed the robot as it was {age_s:.1f} s ago, more than {MAX_AGE_S:g} s:"
            f" {ADVICE}"
        )
    return ""


def _age_s(robot: Robot, time_s: float) -> float:
    """Return the age of a sample in real time."""
    clock = robot.clock
    scale = clock.scale if isinstance(clock, PacedClock) else 1.0
    return (clock.now_ns() / NANOSECONDS - time_s) / scale
