"""Families of servos: entry points of the group ``robotd_serial_servo.families``."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import entry_points

from robotd.api import InvalidArgument, RobotDescriptor, unknown_name
from robotd_serial_servo.device import OpenBus
from robotd_serial_servo.options import SerialServoOptions

GROUP = "robotd_serial_servo.families"


@dataclass(frozen=True)
class Family:
    """One family.

    Attributes:
        options: of its backend.
        open_bus: makes its protocol on an open port.
    """

    options: type[SerialServoOptions]
    open_bus: OpenBus


def family(backend: str) -> Family:
    """Return the family of a backend. Raises InvalidArgument: it has none."""
    entries = {entry.name: entry for entry in entry_points(group=GROUP)}
    if backend not in entries:
        raise InvalidArgument(unknown_name("backend with servos", backend, entries))
    found: Family = entries[backend].load()
    return found


def family_of(robot: RobotDescriptor) -> Family:
    """Return the only family that the robot's file has a section for. Raises InvalidArgument."""
    known = {entry.name for entry in entry_points(group=GROUP)}
    named = sorted(known & robot.backends.keys())
    if len(named) != 1:
        found = " and ".join(named) or "no bus of servos"
        raise InvalidArgument(f"{robot.name} has {found}: name one of {', '.join(sorted(known))}")
    return family(named[0])
