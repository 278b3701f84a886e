"""Life of a managed robot: configure opens, activate switches on, and back.

States and transitions are those of ROS 2 (design: node_lifecycle).
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from enum import Enum, IntEnum
from typing import NamedTuple

from robotd.errors import InvalidArgument, NotReady, RobotdError
from robotd.log import get_logger
from robotd.robot import Robot

log = get_logger("lifecycle")


class LifecycleState(IntEnum):
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


class TransitionResult(Enum):
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
    start: LifecycleState
    goal: LifecycleState


REQUESTS = (
    Transition(1, "configure", LifecycleState.UNCONFIGURED, LifecycleState.CONFIGURING),
    Transition(2, "cleanup", LifecycleState.INACTIVE, LifecycleState.CLEANINGUP),
    Transition(3, "activate", LifecycleState.INACTIVE, LifecycleState.ACTIVATING),
    Transition(4, "deactivate", LifecycleState.ACTIVE, LifecycleState.DEACTIVATING),
    Transition(5, "shutdown", LifecycleState.UNCONFIGURED, LifecycleState.SHUTTINGDOWN),
    Transition(6, "shutdown", LifecycleState.INACTIVE, LifecycleState.SHUTTINGDOWN),
    Transition(7, "shutdown", LifecycleState.ACTIVE, LifecycleState.SHUTTINGDOWN),
)
"""Transitions that a client can ask for."""

# State of a transition: id of its success, and the states after success, failure and error.
_OUTCOMES = {
    LifecycleState.CONFIGURING: (
        10,
        LifecycleState.INACTIVE,
        LifecycleState.UNCONFIGURED,
        LifecycleState.ERRORPROCESSING,
    ),
    LifecycleState.CLEANINGUP: (
        20,
        LifecycleState.UNCONFIGURED,
        LifecycleState.INACTIVE,
        LifecycleState.ERRORPROCESSING,
    ),
    LifecycleState.ACTIVATING: (
        30,
        LifecycleState.ACTIVE,
        LifecycleState.INACTIVE,
        LifecycleState.ERRORPROCESSING,
    ),
    LifecycleState.DEACTIVATING: (
        40,
        LifecycleState.INACTIVE,
        LifecycleState.ACTIVE,
        LifecycleState.ERRORPROCESSING,
    ),
    LifecycleState.SHUTTINGDOWN: (
        50,
        LifecycleState.FINALIZED,
        LifecycleState.FINALIZED,
        LifecycleState.ERRORPROCESSING,
    ),
    LifecycleState.ERRORPROCESSING: (
        60,
        LifecycleState.UNCONFIGURED,
        LifecycleState.FINALIZED,
        LifecycleState.FINALIZED,
    ),
}


def ending(state: LifecycleState, outcome: TransitionResult) -> Transition:
    """Return the transition that ends ``state``, one of those on the way."""
    first, *goals = _OUTCOMES[state]
    label = f"transition_{outcome.name.lower()}"
    return Transition(first + outcome.value, label, state, goals[outcome.value])


GRAPH = (
    *REQUESTS,
    *(ending(state, outcome) for state in _OUTCOMES for outcome in TransitionResult),
)
"""Every transition."""


def available(state: LifecycleState) -> tuple[Transition, ...]:
    """Return the transitions that a client can ask for in ``state``."""
    return tuple(request for request in REQUESTS if request.start is state)


class RobotLifecycle:
    """State machine that starts and stops a robot by the transitions of a managed node.

    ``change`` for workers; it blocks until the transition has ended. ``state`` for any thread.
    Until the robot is active, no servo is switched on and no motion starts.

    Args:
        robot: not started.
        changed: called with every transition when it has happened; must not block.

    Attributes:
        enables_servos: ``activate`` switches the servos of joints and wheels on.
        on_active: called after each activation.
        on_finalized: called once, after the robot was shut down by a client.
    """

    def __init__(self, robot: Robot, changed: Callable[[Transition], None]) -> None:
        self.enables_servos = True
        self.on_active: Callable[[], None] = lambda: None
        self.on_finalized: Callable[[], None] = lambda: None
        self._robot, self._changed = robot, changed
        self._state = LifecycleState.UNCONFIGURED
        self._lock = threading.Lock()
        self._steps = {
            LifecycleState.CONFIGURING: self._configure,
            LifecycleState.CLEANINGUP: self._clean_up,
            LifecycleState.ACTIVATING: self._activate,
            LifecycleState.DEACTIVATING: self._deactivate,
            LifecycleState.SHUTTINGDOWN: robot.shutdown,
        }
        self._restrict()

    @property
    def state(self) -> LifecycleState:
        """State, or the one on the way of the transition that runs."""
        return self._state

    def change(self, transition_id: int, label: str = "") -> bool:
        """Carry out a transition; return True where its success state is reached.

        A transition that fails is logged. One that leaves the robot in doubt closes the device.

        Args:
            label: used instead, unless it is "".

        Raises:
            InvalidArgument: the transition does not start in the present state.
            NotReady: another transition runs.
        """
        if not self._lock.acquire(blocking=False):
            raise NotReady(f"the transition {self._state.label} has not ended")
        try:
            wanted = self._wanted(transition_id, label)
            self._go(wanted)
            outcome = self._run(self._steps[wanted.goal])
            self._go(ending(wanted.goal, outcome))
            if self._state is LifecycleState.ERRORPROCESSING:
                self._process_error()
        finally:
            self._lock.release()
        if outcome is TransitionResult.SUCCESS and self._state is LifecycleState.ACTIVE:
            self.on_active()
        if self._state is LifecycleState.FINALIZED:
            self.on_finalized()
        return outcome is TransitionResult.SUCCESS

    def _wanted(self, transition_id: int, label: str) -> Transition:
        known = available(self._state)
        for transition in known:
            if transition.label == label if label else transition.id == transition_id:
                return transition
        words = ", ".join(f"{transition.label} ({transition.id})" for transition in known) or "none"
        asked = label or transition_id
        raise InvalidArgument(
            f"the robot is {self._state.label}: no transition {asked} (available: {words})"
        )

    def _go(self, transition: Transition) -> None:
        self._state = transition.goal
        self._restrict()
        log.info("lifecycle", state=transition.goal.label, after=transition.label)
        self._changed(transition)

    def _restrict(self) -> None:
        """Allow servos and motion as the state does."""
        latch = self._robot.axes.stop_latch
        latch.inactive = "" if self._state is LifecycleState.ACTIVE else self._state.label
        latch.servos_allowed = self._state in (LifecycleState.ACTIVE, LifecycleState.ACTIVATING)

    def _run(self, step: Callable[[], object]) -> TransitionResult:
        """Return the outcome of a step: a failure leaves the robot in its state before."""
        try:
            step()
        except _Failure as error:
            log.error("transition failed", during=self._state.label, reason=str(error))
            return TransitionResult.FAILURE
        except RobotdError as error:
            log.error("error in a transition", during=self._state.label, reason=str(error))
            return TransitionResult.ERROR
        except Exception:
            log.exception("error in a transition", during=self._state.label)
            return TransitionResult.ERROR
        return TransitionResult.SUCCESS

    def _configure(self) -> None:
        try:
            self._robot.start(enable=False)
        except RobotdError as error:
            with suppress(RobotdError):
                self._robot.connection.close()
            raise _Failure(str(error)) from error

    def _activate(self) -> None:
        if not self.enables_servos:
            return
        try:
            self._robot.servos.enable()
        except RobotdError as error:
            self._robot.servos.disable()
            raise _Failure(str(error)) from error

    def _deactivate(self) -> None:
        self._robot.servos.disable()
        if self._robot.servos.read_only:
            return
        image, names = self._robot.image, self._robot.axes.names
        on = [name for name, is_on in zip(names, image.servo_on.tolist(), strict=True) if is_on]
        if on and self._robot.connection.ready:
            raise NotReady(f"servos could not be switched off: {', '.join(on)}")

    def _clean_up(self) -> None:
        self._robot.connection.close()

    def _process_error(self) -> None:
        """Close the device, which stops motion and switches off: unconfigured, or finalized."""
        self._go(ending(LifecycleState.ERRORPROCESSING, self._run(self._clean_up)))


class _Failure(Exception):
    """A step has failed and was undone."""
