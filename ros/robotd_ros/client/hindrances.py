"""Hindrances of a running robot: faults, a stop, servos off, a speed of 0 %."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass

from std_msgs.msg import Float64, String

from robotd.control.problem import ProblemKind
from robotd_ros.client.ros_client import RosClient
from robotd_ros.node_registry import OPERATOR_NODE
from robotd_ros.qos import LATCHED

STOPPED = f"{OPERATOR_NODE}/stopped"
SPEED = f"{OPERATOR_NODE}/speed"
PROBLEMS = f"{OPERATOR_NODE}/problems"
SPEED_KIND = "speed"
SETTINGS = (ProblemKind.SERVO_OFF, SPEED_KIND)
REMEDIES: dict[str, str] = {
    ProblemKind.CONTROLLER: "robotd recover",
    ProblemKind.ALARM: "robotd recover",
    ProblemKind.OFFLINE: "robotd recover",
    ProblemKind.SERVO_OFF: "robotd servo on",
    ProblemKind.OUTSIDE_LIMITS: "jog it back inside, or correct its position or its limits",
}


@dataclass(frozen=True)
class Hindrance:
    """One reason why axes do not move.

    Attributes:
        kind: a ``ProblemKind``, or "speed".
        text: one line for people.
        remedy: the command that helps; "" where the text names it.
    """

    kind: str
    text: str
    remedy: str = ""

    @property
    def prevents(self) -> bool:
        """False for a joint outside its limits, and for a source that is not armed."""
        return self.kind not in (ProblemKind.OUTSIDE_LIMITS, ProblemKind.SOURCE)

    @property
    def forbids(self) -> bool:
        """False, too, for settings of a client: servos off, the speed."""
        return self.prevents and self.kind not in SETTINGS


class Hindrances:
    """Subscriptions of what keeps the robot from moving; ``stack`` closes them. One thread."""

    def __init__(self, client: RosClient, stack: ExitStack) -> None:
        self._problems = stack.enter_context(client.listen(String, PROBLEMS, LATCHED))
        self._speed = stack.enter_context(client.listen(Float64, SPEED, LATCHED))

    def wait(self) -> tuple[Hindrance, ...]:
        """Return all, when they are known. Raises DeviceTimeout."""
        self._problems.wait()
        self._speed.wait()
        return self.newest

    @property
    def newest(self) -> tuple[Hindrance, ...]:
        """Those known so far; never waits."""
        problems = self._problems.newest.data if self._problems.newest else ""
        return read_hindrances(problems, self.speed)

    @property
    def speed(self) -> float:
        """Of all motion, 0 to 1, as known so far."""
        return self._speed.newest.data if self._speed.newest else 1.0


def read_hindrances(problems: str, speed: float) -> tuple[Hindrance, ...]:
    """Return the hindrances of a message of ``PROBLEMS`` and of the speed."""
    pairs = (line.partition(": ") for line in problems.splitlines())
    found = [Hindrance(kind, text, REMEDIES.get(kind, "")) for kind, _, text in pairs]
    slow = motion_hindrance("", speed)
    return (*found, *([Hindrance(SPEED_KIND, slow)] if slow else []))


def motion_hindrance(stopped: str, speed: float) -> str:
    """Return why motion is not allowed, and the remedy; "" if it is."""
    if stopped:
        return f"motion is stopped: {stopped}; robotd reset allows it again"
    if speed == 0.0:
        return "motion is paused or at speed 0 %; robotd resume or robotd speed allows it again"
    return ""
