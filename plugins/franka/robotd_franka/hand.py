"""The Franka Hand: two driven fingers, closed by output 0.0 as well, with a part at input 0.0.

It has a connection of its own, whose calls wait: a command until the fingers rest, a stop until the
hand has stopped, a state for its packet. So each command has a thread, stops and commands in turn
have one, and states another. ``franky`` has futures of its own for commands; they are not used: one
begins a command at once and then waits without end for the one before.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import franky

from robotd.api import (
    NANOSECONDS,
    Clock,
    ConnectError,
    DeviceTimeout,
    DrivenFingers,
    FloatArray,
    IoDriver,
    NotReady,
    OperationError,
    get_logger,
    wait_until,
)
from robotd_franka.arm_link import FAILURES, connected
from robotd_franka.options import MAX_FORCE_N, HandOptions

log = get_logger("franka")

OLD_S = 0.5  # without a state: where the fingers are is not known
ANSWER_S = 1.0  # from the end of a stop until the command that it stopped has an answer
STILL_M, STILL_S, STILL_STATES = 2e-4, 0.5, 10  # of fingers that a part has stopped
START_S = 3.0  # from a command to the first motion, also on a busy computer
END_S = 3.0  # for the threads; a call into libfranka returns after 1 s without packets
LEAST_STROKE_M = 0.01  # a hand that was not homed since its power came has no stroke
CLOSED_SHARE = 0.05  # of the stroke: closed to that, the fingers grasp, as the hand calls it
LEAST_PART_M = 0.001  # a grasp of nothing succeeds as well, with the fingers together


@dataclass(frozen=True)
class HandState:
    """Content of one state of the hand.

    Attributes:
        time_ns: monotonic time of its arrival.
        width, max_width: distance of the fingers, and that of open ones, m.
        grasped: the last grasp has succeeded, and presses.
    """

    time_ns: int
    width: float
    max_width: float
    grasped: bool

    @property
    def holds(self) -> bool:
        """True while there is a part between the fingers."""
        return self.grasped and self.width > LEAST_PART_M


@dataclass(frozen=True)
class Goal:
    """Commanded distance of the fingers, m, and force, N; 0: that of the options.

    Attributes:
        homes: the fingers find the ends of their stroke instead.
    """

    width: float
    force: float = 0.0
    homes: bool = False


class Command:
    """A call into libfranka that returns when the fingers rest. Any thread.

    Attributes:
        failure: why the hand has not done it; "" while it does, and once it has.
    """

    def __init__(self, call: Callable[[], bool]) -> None:
        self.failure = ""
        self._thread = threading.Thread(
            target=self._run, args=[call], name="franka-hand-command", daemon=True
        )
        self._thread.start()

    def _run(self, call: Callable[[], bool]) -> None:
        try:
            if not call():
                self.failure = "the hand has not done it"
        except FAILURES as error:  # also: it was stopped
            self.failure = str(error)
        if self.failure:
            log.info("the hand has ended a command", reason=self.failure)

    def is_over(self, timeout_s: float = 0.0) -> bool:
        """Wait for the end; return whether it came."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()


class _Standstill:
    """Judges by states that arrive whether fingers have stopped before their command has ended.

    Attributes:
        long: they have moved since ``begin``, and not for STILL_S; or not at all for START_S.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.begin()

    def begin(self) -> None:
        """Begin anew: the fingers are about to move. Any thread."""
        with self._lock:
            self._since: HandState | None = None
            self._states, self._moved, self.long = 0, False, False

    def note(self, state: HandState) -> None:
        """Take a state. Any thread."""
        with self._lock:
            since = self._since
            if since is None or abs(state.width - since.width) > STILL_M:
                self._moved |= since is not None
                self._since, self._states, self.long = state, 0, False
                return
            self._states += 1
            age_ns = state.time_ns - since.time_ns
            limit_s = STILL_S if self._moved else START_S
            self.long = self._states >= STILL_STATES and age_ns > limit_s * NANOSECONDS


class FrankaHand(IoDriver, DrivenFingers):
    """The hand of one arm. ``open`` and ``close``: one worker at a time; the rest: any thread."""

    def __init__(self, model: str, settings: HandOptions, clock: Clock) -> None:
        self._model, self._settings, self._clock = model, settings, clock
        self._state: HandState | None = None
        self._failure = "the hand is not connected"
        self._closed = False  # what the output commands
        self._goal: Goal | None = None  # the newest; None: the fingers stop
        self._begun: Goal | None = None  # the newest that was passed to the hand
        self._command: Command | None = None
        self._still = _Standstill()
        self._asked = threading.Event()  # there is a goal, or the connection ends
        self._closing = threading.Event()
        self._threads: list[threading.Thread] = []

    def open(self, address: str) -> None:
        """Connect; nothing moves. Raises ConnectError."""
        try:
            gripper = connected(lambda: franky.Gripper(address))
            state = self._read(gripper)
        except FAILURES as error:
            text = f"{error} (an arm without a hand needs no --variant hand)"
            raise ConnectError("the hand does not answer", {f"hand at {address}": text}) from error
        self._state, self._failure = state, ""
        self._closed = state.width < 0.5 * state.max_width
        self._goal = self._begun = self._command = None
        self._asked.clear()
        self._closing.clear()
        self._threads = [
            threading.Thread(target=run, args=[gripper], name=name, daemon=True)
            for run, name in (
                (self._watch, "franka-hand-state"),
                (self._replace, "franka-hand"),
            )
        ]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """End the threads; fingers under way stop, and those that hold a part go on holding it."""
        self._closing.set()
        self._asked.set()
        threads, self._threads = self._threads, []
        for thread in threads:
            thread.join(END_S)
        self._failure = self._failure or "the hand is not connected"

    @property
    def names(self) -> Sequence[str]:
        return [f"{self._model}_finger_joint{number}" for number in (1, 2)]

    def read(self, positions: FloatArray) -> None:
        state = self._known
        positions[:] = math.nan if state is None else 0.5 * state.width

    @property
    def input_bytes(self) -> int:
        return 1

    @property
    def output_bytes(self) -> int:
        return 1

    def read_inputs(self, byte: int, length: int) -> bytes:
        state = self._known
        return bytes([state is not None and state.holds])[byte : byte + length]

    def read_outputs(self, byte: int, length: int) -> bytes:
        return bytes([self._closed])[byte : byte + length]

    def write_outputs(self, byte: int, data: bytes) -> None:
        if data:
            self.write_output_bit(byte, 0, bool(data[0] & 1))

    def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
        if not bit:  # the others are of no effect
            self._ask(Goal(0.0 if value else math.inf))

    def move(self, positions: Mapping[str, float], force_n: float) -> None:
        self._ask(Goal(sum(positions.values()), force_n))

    def stop(self) -> None:
        self._goal = None
        self._asked.set()

    @property
    def at_rest(self) -> bool:
        state, command = self._known, self._command
        if state is None or self._begun is not self._goal:
            return False
        rests = self._still.long and not (self._goal and self._goal.homes)  # which turns back
        return command is None or command.is_over() or rests

    def home(self, timeout_s: float) -> None:
        state = self._known
        if state is None:
            raise NotReady(self._failure or "the hand does not answer")
        if state.holds:
            raise NotReady("the hand holds a part, which homing would drop: open it first")
        goal = self._goal = Goal(math.inf, homes=True)
        self._asked.set()

        over_ns = 0  # when the command was seen to be over; a state from before is an old one

        def is_over() -> bool:
            nonlocal over_ns
            found, command = self._known, self._command
            if found is None or self._goal is not goal:
                return True
            if self._begun is not goal or command is None or not command.is_over():
                return False
            over_ns = over_ns or self._clock.now_ns()
            shows_it = found.time_ns > over_ns and found.max_width >= LEAST_STROKE_M
            return bool(command.failure) or shows_it

        ended = wait_until(is_over, timeout_s, self._clock)
        if self._goal is not goal:
            raise OperationError("homing was stopped, or replaced by another command")
        if (state := self._known) is None:
            raise NotReady(self._failure or "the hand does not answer")
        if not ended:
            self.stop()
            raise DeviceTimeout(f"waited {timeout_s:g} s for the hand to be homed")
        if self._command is not None and self._command.failure:
            raise OperationError(f"the hand was not homed: {self._command.failure}")
        self._closed = state.width < 0.5 * state.max_width

    def _ask(self, goal: Goal) -> None:
        """Accept a goal. Raises NotReady."""
        state = self._known
        if state is None:
            raise NotReady(self._failure or "the hand does not answer")
        if state.max_width < LEAST_STROKE_M:
            raise NotReady("the hand is not homed: robotd gripper home, which moves the fingers")
        self._closed = goal.width < 0.5 * state.max_width
        self._goal = goal
        self._asked.set()

    @property
    def _known(self) -> HandState | None:
        """The newest state; None while the connection is lost, or no state comes."""
        state = self._state
        if self._failure or state is None:
            return None
        return state if self._clock.now_ns() - state.time_ns < OLD_S * NANOSECONDS else None

    def _read(self, gripper: franky.Gripper) -> HandState:
        found = gripper.state
        return HandState(self._clock.now_ns(), found.width, found.max_width, bool(found.is_grasped))

    def _watch(self, gripper: franky.Gripper) -> None:
        """Thread of the states: takes each as it arrives."""
        try:
            while not self._closing.is_set():
                self._state = state = self._read(gripper)
                self._still.note(state)
        except FAILURES as error:
            self._failure = f"connection of the hand lost ({error})"
            log.error("hand lost", reason=str(error))

    def _replace(self, gripper: franky.Gripper) -> None:
        """Thread of the commands: a new one stops the one on its way."""
        while self._asked.wait():
            self._asked.clear()  # before the goal is read: a later one is seen
            if self._command is not None and not self._command.is_over():
                _stop(gripper, self._command)
            if self._closing.is_set():
                return
            goal, state = self._goal, self._state
            self._still.begin()
            self._command = self._begin(gripper, goal, state) if goal and state else None
            self._begun = goal

    def _begin(self, gripper: franky.Gripper, goal: Goal, state: HandState) -> Command | None:
        """Begin a goal; None: there is nothing to do."""
        if goal.homes:
            return Command(gripper.homing)
        stroke, speed = state.max_width, self._settings.speed_m_s
        width = min(goal.width, stroke)
        force = min(goal.force, MAX_FORCE_N) or self._settings.force_n
        closes = width <= state.width
        if not closes or not (goal.force or width < CLOSED_SHARE * stroke):
            return Command(lambda: gripper.move(width, speed))
        if state.grasped:
            return None  # the hand fails a grasp of what it has grasped
        return Command(lambda: gripper.grasp(width, speed, force, stroke, stroke))


def _stop(gripper: franky.Gripper, command: Command) -> None:
    """Stop ``command``. Without one under way a stop would release what the fingers hold."""
    try:
        gripper.stop()
    except FAILURES as error:
        log.warning("the hand was not stopped", reason=str(error))
    if not command.is_over(ANSWER_S):
        log.warning("the hand has not answered a command that was stopped")
