"""Reasons why axes cannot move, with their kinds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # commands of the operator need the kinds alone, without NumPy and pydantic
    from robotd.device.connection import Connection
    from robotd.device.process_image import ProcessImage
    from robotd.motion.limits import AxisLimits


class ProblemKind(StrEnum):
    """Kinds of reasons."""

    STARTING = "starting"  # a start-up step is running
    ENDING = "ending"  # the robot is being shut down
    DEVICE = "device"  # no communication, or no fresh values
    CONTROLLER = "controller"  # alarm of the whole controller
    ALARM = "alarm"  # of one drive
    OFFLINE = "offline"  # a drive does not answer
    SERVO_OFF = "servo off"
    STOPPED = "stopped"  # all motion, until a reset
    OUTSIDE_LIMITS = "outside limits"  # a joint; motion is allowed
    SOURCE = "source"  # of commands, rejected until it begins anew; the robot itself can move


@dataclass(frozen=True)
class Problem:
    """One reason.

    Attributes:
        kind: see ``ProblemKind``.
        text: one line for people, with the names of the axes.
        code: of the drive's alarm; 0 for other kinds.
    """

    kind: ProblemKind
    text: str
    code: int = 0

    def __str__(self) -> str:
        return self.text


def find_problems(
    connection: Connection, image: ProcessImage, names: Sequence[str], used: Sequence[int]
) -> list[Problem]:
    """Return the reasons why axes cannot move, root cause first; empty without one.

    Args:
        connection: of the device; while it is not ready, nothing is known of the axes.
        image: consistent copy.
        names: of all axes.
        used: axes that are switched on at start; others count with an alarm only.
    """
    if not connection.commandable:
        return [_device_problem(connection)]
    return [*axis_problems(image, names, used)]


def _device_problem(connection: Connection) -> Problem:
    text = "; ".join(line.strip() for line in connection.rejection.splitlines())
    if connection.ending:
        return Problem(ProblemKind.ENDING, text)
    if connection.step.text and not connection.established:
        return Problem(ProblemKind.STARTING, text)
    return Problem(ProblemKind.DEVICE, text)


def stop_problems(rejection: str) -> list[Problem]:
    """Return the problem of a stop that forbids motion; none where ``rejection`` is ""."""
    return [Problem(ProblemKind.STOPPED, rejection)] if rejection else []


def limit_problems(
    image: ProcessImage, names: Sequence[str], limits: Sequence[AxisLimits]
) -> Iterator[Problem]:
    """Yield each axis whose measured position is outside its limits.

    Its position is wrong, or it was moved there by hand: paths may come back, and go no further.
    """
    for name, position, limit in zip(names, image.position.tolist(), limits, strict=True):
        if outside := limit.excess(position):
            yield Problem(ProblemKind.OUTSIDE_LIMITS, f"{name}: {outside}")


def axis_problems(
    image: ProcessImage, names: Sequence[str], used: Sequence[int]
) -> Iterator[Problem]:
    """Yield the problems of a device that is ready. Arguments as of ``find_problems``."""
    if image.controller_fault:
        yield Problem(ProblemKind.CONTROLLER, image.controller_fault)
        return
    faulty = [axis for axis in range(len(names)) if image.amp_alarm[axis]]
    faulty += [axis for axis in used if image.offline[axis] and axis not in faulty]
    for axis in faulty:
        kind = ProblemKind.OFFLINE if image.offline[axis] else ProblemKind.ALARM
        code = int(image.alarm_code[axis]) if kind is ProblemKind.ALARM else 0
        yield Problem(kind, f"{names[axis]}: {image.fault(axis)}", code)
    off = [names[axis] for axis in used if not image.servo_on[axis] and axis not in faulty]
    if off:
        yield Problem(ProblemKind.SERVO_OFF, f"servo off: {', '.join(off)}")
