"""Problems of a robot, found once for all who show them."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from robotd.control.groups.problem import REMEDIES, Problem, ProblemKind
from robotd.control.loop.rearming import Rearming
from robotd.device.axes import Axes
from robotd.device.state import GUIDING


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
        used: axes that are switched on at start; others count with an alarm only.
        advise: returns what to do about the code of an alarm; "" where that is not known.
    """

    def __init__(
        self, axes: Axes, rearming: Rearming, used: Sequence[int], advise: Callable[[int], str]
    ) -> None:
        self._connection, self._axes, self._rearming = axes.connection, axes, rearming
        self._clock, self._used, self._advise = axes.clock, list(used), advise
        self._since_ns: dict[tuple[ProblemKind, tuple[str, ...], int], int] = {}
        self._lock = threading.Lock()  # of the times
        self._newest: tuple[float, list[Problem]] = (-math.inf, [])  # with the time before

    def find(self, max_age_s: float = 0.0) -> list[Problem]:
        """Return all of them, root cause first; empty without one.

        A driver may be asked for its reason, which takes up to 0.5 s where it hangs.

        ``max_age_s``: those that were found within this time will do.
        """
        began_s = time.monotonic()
        found_s, newest = self._newest
        if began_s - found_s >= max_age_s:
            newest = self._find()
            self._newest = began_s, newest
        return [*newest]

    def _find(self) -> list[Problem]:
        found = [*self._not_stopped(), *self.recoverable(), *self._lasting()]
        with self._lock:
            before, now_ns = self._since_ns, self._clock.now_ns()
            keys = [(problem.kind, problem.axes, problem.code) for problem in found]
            self._since_ns = {key: before.get(key, now_ns) for key in keys}
            times_ns = [self._since_ns[key] for key in keys]
        return [
            replace(problem, remedy=problem.remedy or self._remedy(problem), since_ns=since_ns)
            for problem, since_ns in zip(found, times_ns, strict=True)
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

    def _not_stopped(self) -> Iterator[Problem]:
        """Yield axes whose stops have failed or had no effect, also of a device that is lost."""
        for axis, reason in self._axes.stops.unconfirmed():
            text = f"its stop is not confirmed: {reason}"
            yield Problem(ProblemKind.NOT_STOPPED, text, (self._axes.names[axis],))

    def _of_drives(self) -> Iterator[Problem]:
        image, names = self._axes.image.copy(), self._axes.names
        if image.controller_fault:
            code = image.controller_alarm
            yield Problem(ProblemKind.CONTROLLER, image.controller_fault, code=code)
            return
        faulty = [axis for axis in range(len(names)) if image.amp_alarm[axis]]
        faulty += [axis for axis in self._used if image.offline[axis] and axis not in faulty]
        for axis in faulty:
            kind = ProblemKind.OFFLINE if image.offline[axis] else ProblemKind.ALARM
            code = int(image.alarm_code[axis]) if kind is ProblemKind.ALARM else 0
            yield Problem(kind, image.fault(axis), (names[axis],), code)
        on = image.servo_on | (image.operation == GUIDING)
        off = [axis for axis in self._used if not on[axis] and axis not in faulty]
        for reason in dict.fromkeys(image.reason[axis] for axis in off):
            text = f"servo off ({reason})" if reason else "servo off"
            alike = tuple(names[axis] for axis in off if image.reason[axis] == reason)
            yield Problem(ProblemKind.SERVO_OFF, text, alike)

    def _lasting(self) -> Iterator[Problem]:
        """Yield those that no recovery removes."""
        axes = self._axes
        if cause := axes.stop_latch.cause:
            remedy = "Its lifecycle manager has to activate it" if axes.stop_latch.inactive else ""
            yield Problem(ProblemKind.STOPPED, cause, remedy=remedy)
        if not axes.speed.scale:
            reason, command = "the speed is 0 %", "robotd speed 100"
            if axes.speed.paused:
                reason, command = "motion is paused", "robotd resume"
            yield Problem(ProblemKind.PAUSED, reason, remedy=f"To go on: {command}")
        if self._connection.commandable:
            yield from limit_problems(axes)
        for reason, remedy in {limit.reason: limit.remedy for limit in axes.motion_limits}.items():
            if reason:
                yield Problem(ProblemKind.REDUCED_SPEED, reason, remedy=remedy)
        for text in self._rearming.unarmed():
            yield Problem(ProblemKind.SOURCE, text)

    def _remedy(self, problem: Problem) -> str:
        if problem.code and (advice := self._advise(problem.code)):
            return f"{advice}, then: robotd recover"
        return REMEDIES.get(problem.kind, "")
