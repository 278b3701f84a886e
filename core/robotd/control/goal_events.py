"""Events of trajectory goals: accepted with their points, rejected, and ended."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from robotd.control.completion import Outcome
from robotd.control.trajectory_execution import TrajectoryExecution
from robotd.errors import RobotdError
from robotd.events import EventKind, EventLog, Level
from robotd.motion import TrajectoryRequest

SUBJECT = "goal"
BAD = frozenset({Outcome.FAULT, Outcome.PATH_TOLERANCE, Outcome.GOAL_TOLERANCE})


@contextmanager
def noted_rejection(events: EventLog, request: TrajectoryRequest) -> Iterator[None]:
    """Note a RobotdError of the block as the rejection of ``request``."""
    try:
        yield
    except RobotdError as error:
        data = {"outcome": "rejected", "joints": list(request.joint_names)}
        text = f"goal rejected: {error}"
        events.add(EventKind.GOAL, SUBJECT, text, level=Level.WARNING, data=data)
        raise


def note_goal(events: EventLog, request: TrajectoryRequest, execution: TrajectoryExecution) -> None:
    """Note an accepted goal with the points as the client gave them."""
    points = {
        "positions": request.positions,
        "velocities": request.velocities,
        "accelerations": request.accelerations,
    }
    duration_s = float(request.times_s[-1]) if len(request.times_s) else 0.0
    data = {
        "outcome": "accepted",
        "id": id(execution),
        "start_ns": execution.start_ns,
        "joints": list(request.joint_names),
        "times_s": request.times_s,
        **{name: rows for name, rows in points.items() if rows is not None},
    }
    count = len(request.times_s)
    text = f"goal of {count} point{'s' if count != 1 else ''} over {duration_s:.3f} s"
    events.add(EventKind.GOAL, SUBJECT, text, data=data)


def note_result(events: EventLog, execution: TrajectoryExecution) -> None:
    """Note the outcome of a goal."""
    outcome = execution.outcome or Outcome.FAULT
    word = outcome.name.lower()
    text = f"goal {word}: {execution.message}"
    completion = execution.completion
    if completion.outcome not in (outcome, Outcome.PREEMPTED, None):
        text = f"{text}; behind its last point: {completion.message}"
    data = {"outcome": word, "id": id(execution)}
    level = Level.INFO if BAD.isdisjoint({outcome, completion.outcome}) else Level.ERROR
    events.add(EventKind.RESULT, SUBJECT, text, level=level, data=data)
