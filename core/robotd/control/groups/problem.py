"""Problem: a reason why axes do not move, as data."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class ProblemKind(StrEnum):
    """Kinds of reasons."""

    STARTING = "starting"  # a start-up step is running
    ENDING = "ending"  # the robot is being shut down
    DEVICE = "device"  # no communication, or no fresh values
    CONTROLLER = "controller"  # alarm of the whole controller
    ALARM = "alarm"  # of one drive
    OFFLINE = "offline"  # a drive does not answer
    NOT_STOPPED = "not stopped"  # an axis: its stop has failed, or has no effect
    SERVO_OFF = "servo off"
    STOPPED = "stopped"  # all motion, until a reset
    PAUSED = "paused"  # all motion, or its speed is 0 %
    OUTSIDE_LIMITS = "outside limits"  # a joint; motion is allowed
    REDUCED_SPEED = "reduced speed"  # of a joint group; motion is allowed
    SOURCE = "source"  # of commands, rejected until it begins anew; the robot itself can move


FAULTS = (
    ProblemKind.DEVICE,
    ProblemKind.CONTROLLER,
    ProblemKind.ALARM,
    ProblemKind.OFFLINE,
    ProblemKind.NOT_STOPPED,
)
SETTINGS = (ProblemKind.SERVO_OFF, ProblemKind.PAUSED)
NOTICES = (ProblemKind.OUTSIDE_LIMITS, ProblemKind.REDUCED_SPEED, ProblemKind.SOURCE)

REMEDIES = {
    ProblemKind.DEVICE: "Check the power and the cables of the device, then: robotd recover",
    ProblemKind.CONTROLLER: "Remove the cause, then: robotd recover",
    ProblemKind.ALARM: "Remove the cause, then: robotd recover",
    ProblemKind.OFFLINE: "Check the power and the cable of the drive, then: robotd recover",
    ProblemKind.NOT_STOPPED: "It is repeated. If the axis moves on: emergency stop",
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
        code: of the alarm, the drive's or the controller's; 0 for other kinds.
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
        """False for a joint outside its limits, reduced speed, and a source that is not armed."""
        return self.kind not in NOTICES

    @property
    def forbids_motion(self) -> bool:
        """True for causes that prevent motion, except settings of a client, such as the speed."""
        return self.prevents_motion and self.kind not in SETTINGS
