"""States and transitions of a managed node, as ROS 2 defines them (design: node_lifecycle)."""

from __future__ import annotations

from enum import Enum, IntEnum
from typing import NamedTuple


class State(IntEnum):
    """States by their ids in ``lifecycle_msgs/msg/State``; a label is the name in lower case."""

    UNKNOWN = 0
    UNCONFIGURED = 1
    INACTIVE = 2
    ACTIVE = 3
    FINALIZED = 4
    CONFIGURING = 10
    CLEANINGUP = 11
    SHUTTINGDOWN = 12
    ACTIVATING = 13
    DEACTIVATING = 14
    ERRORPROCESSING = 15

    @property
    def label(self) -> str:
        """The label of the state."""
        return self.name.lower()


class Outcome(Enum):
    """Result of a transition, by the last digit of its id."""

    SUCCESS = 0
    FAILURE = 1
    ERROR = 2


class Transition(NamedTuple):
    """One edge of the graph.

    Attributes:
        id: of ``lifecycle_msgs/msg/Transition``.
        label: word by which clients ask for it, or of its outcome.
        start, goal: states.
    """

    id: int
    label: str
    start: State
    goal: State


REQUESTS = (
    Transition(1, "configure", State.UNCONFIGURED, State.CONFIGURING),
    Transition(2, "cleanup", State.INACTIVE, State.CLEANINGUP),
    Transition(3, "activate", State.INACTIVE, State.ACTIVATING),
    Transition(4, "deactivate", State.ACTIVE, State.DEACTIVATING),
    Transition(5, "shutdown", State.UNCONFIGURED, State.SHUTTINGDOWN),
    Transition(6, "shutdown", State.INACTIVE, State.SHUTTINGDOWN),
    Transition(7, "shutdown", State.ACTIVE, State.SHUTTINGDOWN),
)
"""Transitions that a client can ask for."""

# State of a transition: id of its success, and the states after success, failure and error.
_OUTCOMES = {
    State.CONFIGURING: (10, State.INACTIVE, State.UNCONFIGURED, State.ERRORPROCESSING),
    State.CLEANINGUP: (20, State.UNCONFIGURED, State.INACTIVE, State.ERRORPROCESSING),
    State.ACTIVATING: (30, State.ACTIVE, State.INACTIVE, State.ERRORPROCESSING),
    State.DEACTIVATING: (40, State.INACTIVE, State.ACTIVE, State.ERRORPROCESSING),
    State.SHUTTINGDOWN: (50, State.FINALIZED, State.FINALIZED, State.ERRORPROCESSING),
    State.ERRORPROCESSING: (60, State.UNCONFIGURED, State.FINALIZED, State.FINALIZED),
}


def ending(state: State, outcome: Outcome) -> Transition:
    """Return the transition that ends ``state``, one of those on the way."""
    first, *goals = _OUTCOMES[state]
    label = f"transition_{outcome.name.lower()}"
    return Transition(first + outcome.value, label, state, goals[outcome.value])


GRAPH = (*REQUESTS, *(ending(state, outcome) for state in _OUTCOMES for outcome in Outcome))
"""Every transition."""


def available(state: State) -> tuple[Transition, ...]:
    """Return the transitions that a client can ask for in ``state``."""
    return tuple(each for each in REQUESTS if each.start is state)
