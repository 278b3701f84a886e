"""Changing part of what the page shows: state, problems, goal, I/O, fieldbus, events."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any

from robotd.api import BusStatus, CommandMode, Operation, RobotdError
from robotd.api.features import MAX_IO_BYTES, Event, EventKind, Tap
from robotd.api.robots import JointGroup, Problem, Robot, TrajectoryExecution

SHARED_S = 0.15  # age of problems that do for an observer: the diagnostics look each 0.1 s
MAX_GOALS = 64  # accepted goals whose sender is remembered
MODES = {int(mode): mode.name.lower() for mode in CommandMode}
OPERATIONS = {int(operation): operation.name.lower() for operation in Operation}
SWITCHES = ("home_switch", "negative_limit", "positive_limit")


def state_of(
    tap: Tap, goals: Sequence[Mapping[str, Any] | None], viewers: int, max_age_s: float = 0.0
) -> dict[str, Any]:
    """Return the state now.

    Args:
        goals: from ``Goals.running``.
        viewers: number of viewers.
        max_age_s: of the problems, see ``Robot.find_problems``.
    """
    robot = tap.robot
    speed = robot.axes.speed
    return {
        "type": "state",
        "device": robot.connection.state.value,
        "ready": robot.connection.ready,
        "problems": [*map(_problem, robot.find_problems(max_age_s))],
        "speed": speed.speed,
        "paused": speed.paused,
        "axes": _axes(robot),
        "goals": goals,
        "inputs": _hexadecimal(robot.io.input_bytes, robot.io.sizes[0]),
        "outputs": _hexadecimal(robot.io.output_bytes, robot.io.sizes[1]),
        "buses": [_bus(number, status) for number, status in tap.buses.items()],
        "missed": robot.control_loop.stats.missed,
        "viewers": viewers,
    }


class Goals:
    """Running goal of each joint group with the client that sent it. One thread."""

    def __init__(self, robot: Robot) -> None:
        self._groups = robot.groups
        self._senders: dict[int, str] = {}  # of the newest goals, by identity

    def note(self, event: Event) -> None:
        """Note the sender of a goal that was accepted."""
        if event.kind is EventKind.GOAL and event.data.get("outcome") == "accepted":
            self._senders[int(event.data["id"])] = event.sender
            if len(self._senders) > MAX_GOALS:
                del self._senders[next(iter(self._senders))]

    def running(self) -> list[dict[str, Any] | None]:
        """Return the goal of each group, None where there is none.

        With duration, joints, sender and, while it stops, the reason.
        """
        return [self._goal(group) for group in self._groups.values()]

    def _goal(self, group: JointGroup) -> dict[str, Any] | None:
        source = group.motion.running
        if not isinstance(source, TrajectoryExecution):
            return None
        ending = source.completion.requested
        return {
            "duration_s": source.trajectory.duration_s,
            "joints": [*source.trajectory.names],
            "sender": self._senders.get(id(source), ""),
            "ending": ending[1] if ending else "",
        }


def event_of(event: Event) -> dict[str, Any]:
    """Return an event without its data."""
    return {
        "time_s": event.time_ns * 1e-9,
        "kind": str(event.kind),
        "subject": event.subject,
        "text": event.text,
        "level": str(event.level),
        "sender": event.sender,
    }


def _problem(problem: Problem) -> dict[str, Any]:
    return {
        "kind": str(problem.kind),
        "is_fault": problem.is_fault,
        "text": str(problem),
        "axes": problem.axes,
        "code": problem.code,
        "remedy": problem.remedy,
        "since_s": problem.since_ns * 1e-9,
    }


def _axes(robot: Robot) -> list[dict[str, Any]]:
    # Without a copy of the image, which takes as long as all of this: values of two periods beside
    # each other are shown for one look at most. As lists: an element takes ten times as long.
    image = robot.image
    servos, offline = image.servo_on.tolist(), image.offline.tolist()
    modes, operations = image.mode.tolist(), image.operation.tolist()
    switches = {name: getattr(image, name).tolist() for name in SWITCHES}
    return [
        {
            "servo": servos[axis],
            "offline": offline[axis],
            "fault": image.fault(axis),
            "mode": MODES[modes[axis]],
            "operation": OPERATIONS[operations[axis]],
            "owner": robot.axes.owner(axis),
            "switches": [name for name, levels in switches.items() if levels[axis]],
        }
        for axis in range(image.axes)
    ]


def _bus(number: int, status: BusStatus) -> dict[str, Any]:
    return {
        "name": f"bus {number}",
        "state": status.state.value,
        "lost_frames": status.lost_frames,
        "timeouts": status.timeouts,
        "late_cycles": status.late_cycles,
        "note": status.note,
        "details": dict(status.details),
        "nodes": [
            {
                "id": node.id,
                "state": "offline" if node.offline else node.state.value,
                "offline": node.offline,
                "error_code": node.error_code,
                "axes": node.axes,
                "inputs": node.input_size,
                "outputs": node.output_size,
                "fault": node.fault,
            }
            for node in status.nodes
        ],
    }


def _hexadecimal(read: Callable[[int, int], bytes], size: int) -> str:
    """Return an image of ``size`` bytes in hexadecimal digits; "" while it is not known."""
    size = min(size, MAX_IO_BYTES)
    with suppress(RobotdError):
        return read(0, size).hex() if size else ""
    return ""
