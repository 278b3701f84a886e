"""Problems: reasons why axes do not move, found once for all who show them."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # commands of the operator need the data alone, without NumPy and pydantic
    from robotd.clock import Clock
    from robotd.control.rearming import Rearming
    from robotd.device.axes import Axes
    from robotd.device.connection import Connection


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
    PAUSED = "paused"  # all motion, or its speed is 0 %
    OUTSIDE_LIMITS = "outside limits"  # a joint; motion is allowed
    SOURCE = "source"  # of commands, rejected until it begins anew; the robot itself can move


FAULTS = (ProblemKind.DEVICE, ProblemKind.CONTROLLER, ProblemKind.ALARM, ProblemKind.OFFLINE)
SETTINGS = (ProblemKind.SERVO_OFF, ProblemKind.PAUSED)
NOTICES = (ProblemKind.OUTSIDE_LIMITS, ProblemKind.SOURCE)

REMEDIES = {
    ProblemKind.DEVICE: "Check the power and the cables of the device, then: robotd recover",
    ProblemKind.CONTROLLER: "Remove the cause, then: robotd recover",
    ProblemKind.ALARM: "Remove the cause, then: robotd recover",
    ProblemKind.OFFLINE: "Check the power and the cable of the drive, then: robotd recover",
    ProblemKind.SERVO_OFF: "To switch it on: robotd servo on",
    ProblemKind.STOPPED: "When it is safe to move: robotd reset",
    ProblemKind.OUTSIDE_LIMITS: "Jog it back inside, or correct its position or its limits",
}


@dataclass(frozen=True)
class Problem:
    """One reason.

    Attributes:
        kind: see ``ProblemKind``.
        reason: one line for people, without the axes.
        axes: names of the axes that it is about; empty: it is about all of them.
        code: of the drive's alarm; 0 for other kinds.
        remedy: what to do about it, one line; "" where nothing helps, or ``reason`` says it.
        since_ns: time at which it was first seen, on the robot's clock.
    """

    kind: ProblemKind
    reason: str
    axes: tuple[str, ...] = ()
    code: int = 0
    remedy: str = ""
    since_ns: int = 0

    @property
    def text(self) -> str:
        """One line for people, with the axes."""
        return f"{', '.join(self.axes)}: {self.reason}" if self.axes else self.reason

    def __str__(self) -> str:
        return self.text

    @property
    def is_fault(self) -> bool:
        """Something is broken, or has to be connected."""
        return self.kind in FAULTS

    @property
    def prevents_motion(self) -> bool:
        """False for a joint outside its limits, and for a source that is not armed."""
        return self.kind not in NOTICES

    @property
    def forbids_motion(self) -> bool:
        """It prevents motion, and is no setting of a client, as a servo or the speed are."""
        return self.prevents_motion and self.kind not in SETTINGS


def limit_problems(axes: Axes) -> Iterator[Problem]:
    """Yield each axis whose measured position is outside its limits.

    Its position is wrong, or it was moved there by hand: paths may come back, and go no further.
    """
    positions = axes.image.position.tolist()
    for name, position, limits in zip(axes.names, positions, axes.limits, strict=True):
        if outside := limits.excess(position):
            yield Problem(ProblemKind.OUTSIDE_LIMITS, outside, (name,))


class Problems:
    """Problems of a robot. Any thread.

    Args:
        connection, axes, rearming, clock: of the robot.
        used: axes that are switched on at start; others count with an alarm only.
        advise: returns what to do about the code of an alarm; "" where that is not known.
    """

    def __init__(
        self,
        connection: Connection,
        axes: Axes,
        rearming: Rearming,
        clock: Clock,
        used: Sequence[int],
        advise: Callable[[int], str],
    ) -> None:
        self._connection, self._axes, self._rearming = connection, axes, rearming
        self._clock, self._used, self._advise = clock, list(used), advise
        self._since_ns: dict[tuple[ProblemKind, tuple[str, ...], int], int] = {}
        self._lock = threading.Lock()  # of the times

    def find(self) -> list[Problem]:
        """Return all of them, root cause first; empty without one.

        A driver may be asked for its reason, which takes up to 0.5 s where it hangs.
        """
        found = [*self.recoverable(), *self._lasting()]
        with self._lock:
            before, now_ns = self._since_ns, self._clock.now_ns()
            keys = [(each.kind, each.axes, each.code) for each in found]
            self._since_ns = {key: before.get(key, now_ns) for key in keys}
            times_ns = [self._since_ns[key] for key in keys]
        return [
            replace(each, remedy=each.remedy or self._remedy(each), since_ns=since_ns)
            for each, since_ns in zip(found, times_ns, strict=True)
        ]

    def recoverable(self) -> list[Problem]:
        """Return those that a recovery removes, without remedies and times."""
        connection = self._connection
        if not connection.commandable:  # nothing is known of the axes
            reason = "; ".join(line.strip() for line in connection.rejection.splitlines())
            kind = ProblemKind.DEVICE
            if connection.ending:
                kind = ProblemKind.ENDING
            elif connection.step.text and not connection.established:
                kind = ProblemKind.STARTING
            return [Problem(kind, reason)]
        return [*self._of_drives()]

    def _of_drives(self) -> Iterator[Problem]:
        image, names = self._axes.image.copy(), self._axes.names
        if image.controller_fault:
            yield Problem(ProblemKind.CONTROLLER, image.controller_fault)
            return
        faulty = [axis for axis in range(len(names)) if image.amp_alarm[axis]]
        faulty += [axis for axis in self._used if image.offline[axis] and axis not in faulty]
        for axis in faulty:
            kind = ProblemKind.OFFLINE if image.offline[axis] else ProblemKind.ALARM
            code = int(image.alarm_code[axis]) if kind is ProblemKind.ALARM else 0
            yield Problem(kind, image.fault(axis), (names[axis],), code)
        off = [axis for axis in self._used if not image.servo_on[axis] and axis not in faulty]
        if off:
            yield Problem(ProblemKind.SERVO_OFF, "servo off", tuple(names[axis] for axis in off))

    def _lasting(self) -> Iterator[Problem]:
        """Yield those that no recovery removes."""
        axes = self._axes
        if rejection := axes.stop_latch.rejection:
            yield Problem(ProblemKind.STOPPED, rejection)
        if not axes.speed.scale:
            reason, command = "the speed is 0 %", "robotd speed 100"
            if axes.speed.paused:
                reason, command = "motion is paused", "robotd resume"
            yield Problem(ProblemKind.PAUSED, reason, remedy=f"To go on: {command}")
        if self._connection.commandable:
            yield from limit_problems(axes)
        yield from self._rearming.problems()

    def _remedy(self, problem: Problem) -> str:
        if problem.kind is ProblemKind.ALARM and (advice := self._advise(problem.code)):
            return f"{advice}, then: robotd recover"
        return REMEDIES.get(problem.kind, "")
