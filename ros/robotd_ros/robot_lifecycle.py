"""Life of a managed robot: configure opens, activate switches on, and back."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress

from robotd.errors import InvalidArgument, NotReady, RobotdError
from robotd.log import get_logger
from robotd.robot import Robot
from robotd_ros.lifecycle_table import Outcome, State, Transition, available, ending

log = get_logger("lifecycle")


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
        self._state = State.UNCONFIGURED
        self._lock = threading.Lock()
        self._steps = {
            State.CONFIGURING: self._configure,
            State.CLEANINGUP: self._clean_up,
            State.ACTIVATING: self._activate,
            State.DEACTIVATING: self._deactivate,
            State.SHUTTINGDOWN: self._shut_down,
        }
        self._restrict()

    @property
    def state(self) -> State:
        """State, or the one on the way of the transition that runs."""
        return self._state

    def change(self, transition_id: int, label: str = "") -> bool:
        """Carry out a transition; return True where its success state is reached.

        A transition that fails is logged. One that leaves the robot in doubt closes the device.

        Args:
            transition_id: id of the transition.
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
            if self._state is State.ERRORPROCESSING:
                self._process_error()
        finally:
            self._lock.release()
        if outcome is Outcome.SUCCESS and self._state is State.ACTIVE:
            self.on_active()
        if self._state is State.FINALIZED:
            self.on_finalized()
        return outcome is Outcome.SUCCESS

    def _wanted(self, transition_id: int, label: str) -> Transition:
        known = available(self._state)
        for each in known:
            if each.label == label if label else each.id == transition_id:
                return each
        words = ", ".join(f"{each.label} ({each.id})" for each in known) or "none"
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
        latch.inactive = "" if self._state is State.ACTIVE else self._state.label
        latch.servos_allowed = self._state in (State.ACTIVE, State.ACTIVATING)

    def _run(self, step: Callable[[], None]) -> Outcome:
        """Return the outcome of a step: a failure leaves the robot in its state before."""
        try:
            step()
        except _Failure as error:
            log.error("transition failed", during=self._state.label, reason=str(error))
            return Outcome.FAILURE
        except RobotdError as error:
            log.error("error in a transition", during=self._state.label, reason=str(error))
            return Outcome.ERROR
        except Exception:
            log.exception("error in a transition", during=self._state.label)
            return Outcome.ERROR
        return Outcome.SUCCESS

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

    def _shut_down(self) -> None:
        self._robot.shutdown()

    def _process_error(self) -> None:
        """Close the device, which stops motion and switches off: unconfigured, or finalized."""
        self._go(ending(State.ERRORPROCESSING, self._run(self._clean_up)))


class _Failure(Exception):
    """A step has failed and was undone."""
