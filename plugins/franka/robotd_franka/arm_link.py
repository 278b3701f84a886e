"""Connection to one arm: its state, and the impedance controller that follows targets.

``franky`` keeps FCI's loop of 1 kHz in a C++ thread. Its methods ``state`` and ``is_in_control``
may wait for a packet, up to a second where none comes: only the thread of this link calls them
while the control loop runs. All calls into ``franky`` that wait release the interpreter.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import TypeVar

import franky
import numpy as np

from robotd.api import (
    NANOSECONDS,
    Clock,
    ConnectError,
    FloatArray,
    NotReady,
    OperationError,
    Payload,
    get_logger,
)
from robotd_franka.code_tables import ERRORS, GUIDING, IDLE, REFLEX, alarm_of
from robotd_franka.options import JOINTS, FrankaOptions, is_loopback

log = get_logger("franka")

Connection = TypeVar("Connection")

CONNECT_S = 10.0  # for a connection, which a control unit that serves another client never answers
POLL_S = 0.001  # FCI sends a state per millisecond
SILENT_S = 0.03  # without a state: a real arm has ended the motion after 0.02 s of lost packets
MISSING_S = 0.008  # the same, of an arm while the thread of the link has looked for one
END_S = 3.0  # for the thread; a call into libfranka returns after 1 s without packets
GUIDING_DAMPING = 2.0  # N·m·s/rad
NO_VELOCITY: FloatArray = np.zeros(JOINTS)
FAILURES = (franky.Exception, RuntimeError)  # RuntimeError: of libfranka's sockets


@dataclass(frozen=True)
class ArmState:
    """Content of one state of the arm.

    Attributes:
        time_ns: monotonic time of its arrival.
        position, velocity, torque: (7,) measured at the joints, rad, rad/s, N·m.
        mode: number of libfranka's ``RobotMode``.
        errors: names of its errors in a reflex.
        followed: the impedance controller follows targets.
        reported: all that the library has of the state.
    """

    time_ns: int
    position: FloatArray
    velocity: FloatArray
    torque: FloatArray
    mode: int
    errors: tuple[str, ...]
    followed: bool
    reported: franky.RobotState


class ArmLink:
    """Connection by FCI, with a thread that reads the state. Any thread, except ``set_target``.

    Attributes:
        state: newest state of the arm; None before the first one.
        failure: reason why the connection is lost; "" while it is there.
        ended: reason why the arm has ended the last motion by itself; "" if it has not.
        starts: how often the impedance controller was started.

    Raises ConnectError: the arm does not answer, or does not accept this client.
    """

    def __init__(self, options: FrankaOptions, clock: Clock) -> None:
        self.state: ArmState | None = None
        self.failure = self.ended = ""
        self.starts = 0
        self._options, self._clock = options, clock
        self._stiffness, self._damping = _gains(options)
        # A simulated controller is as late as this computer.
        self._missing_s = SILENT_S if is_loopback(options.address) else MISSING_S
        self._robot = _connect(options)
        self._tracker: franky.JointImpedanceTracker | None = None
        self._target: FloatArray | None = None
        self._moves = False  # the newest target has a velocity
        self._sent_ns = self._looked_ns = 0
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="franka-state", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the motion, the thread and the connection."""
        with suppress(*FAILURES):
            self.end_following()
        self._closing.set()
        self._thread.join(END_S)

    def configure(self, payload: Payload) -> None:
        """Set load and collision thresholds. Raises OperationError: the arm rejects them."""
        options = self._options
        torque, force = [options.collision_torque_nm] * JOINTS, [options.collision_force_n] * 6
        try:
            self._robot.set_collision_behavior(torque, torque, force, force)
        except FAILURES as error:
            raise OperationError(f"collision thresholds: {error}") from error
        self.set_load(payload)

    def set_load(self, payload: Payload) -> None:
        """Set the load, while nothing follows targets. Raises OperationError: it is rejected."""
        options = self._options
        own = payload == options.payload
        inertia = np.diag(options.load_inertia_kg_m2 if own else (0.0, 0.0, 0.0))
        try:
            self._robot.set_load(
                payload.mass_kg, list(payload.center_m), inertia.flatten().tolist()
            )
        except FAILURES as error:
            raise OperationError(f"load of {payload}: {error}") from error

    def follow(self) -> None:
        """Start the impedance controller, which holds the measured position.

        Raises NotReady: the arm is in a mode that does not take it.
        """
        state = self.state
        if state is None or state.mode != IDLE:
            raise NotReady(_why_not(state))
        self.ended, self._target, self._moves = "", None, False
        self.starts += 1
        try:
            self._tracker = franky.JointImpedanceTracker(
                self._robot, stiffness=self._stiffness, damping=self._damping
            )
        except FAILURES as error:
            raise OperationError(str(error)) from error

    def end_following(self) -> None:
        """Brake the arm by damping and end the controller; the arm then holds itself.

        Takes 0.3 s at rest, 2 s at most. Raises one of FAILURES: the arm had ended it.
        """
        tracker, self._tracker = self._tracker, None
        if tracker is not None:
            tracker.stop()

    def set_target(self, position: FloatArray, velocity: FloatArray) -> None:
        """Give the controller a target, (7,) rad and rad/s. Control-loop thread; never blocks."""
        tracker = self._tracker
        if tracker is not None:
            self._sent_ns = self._clock.now_ns()
            self._target, self._moves = position, bool(velocity.any())
            tracker.set_target(position, velocity)

    def soften(self, axes: Sequence[int]) -> None:
        """Take the stiffness of ``axes`` away, so that a person can lead them; of others: back."""
        tracker = self._tracker
        if tracker is None:
            return
        stiffness, damping = self._stiffness.copy(), self._damping.copy()
        stiffness[list(axes)], damping[list(axes)] = 0.0, GUIDING_DAMPING
        tracker.set_gains(stiffness=stiffness, damping=damping)

    def recover(self) -> None:
        """End a reflex; nothing moves. Raises OperationError: the arm does not leave it."""
        try:
            self._robot.recover_from_errors()
        except FAILURES as error:
            raise OperationError(f"the arm does not recover: {error}") from error

    @property
    def silent(self) -> bool:
        """True while no state arrives, so that the impedance controller follows no target.

        Judged before a motion ends by that: what is sent meanwhile would be followed at once. A
        thread that had no processor for a moment is no silence of the arm.
        """
        state = self.state
        if state is None or self._looked_ns - state.time_ns > self._missing_s * NANOSECONDS:
            return True
        return self._clock.now_ns() - state.time_ns > SILENT_S * NANOSECONDS

    @property
    def silence(self) -> str:
        """Reason why no fresh values arrive; "" while they do."""
        if self.failure or self.state is None:
            return self.failure or "no state yet"
        age_s = (self._clock.now_ns() - self.state.time_ns) / NANOSECONDS
        return f"no state from the arm for {age_s:.1f} s" if self.silent else ""

    def _watch(self) -> None:
        """Thread of the state."""
        newest_ms = -1
        while not self._closing.is_set():
            try:
                newest_ms = self._look(newest_ms)
            except FAILURES as error:
                self._tracker = None  # libfranka ends the motion with the connection
                self.failure = f"connection lost ({error})"
                return
            self._closing.wait(POLL_S)

    def _look(self, newest_ms: int) -> int:
        """Take a state that is newer than ``newest_ms``; return its time."""
        tracker = self._tracker  # first: one that begins meanwhile has not ended
        found = self._robot.state
        followed = self._robot.is_in_control
        time_ms = int(found.time.to_msec())
        if tracker is not None and tracker is self._tracker and not followed:
            self._note_end()
        if time_ms != newest_ms:
            self.state = self._read(found, followed)
        self._looked_ns = self._clock.now_ns()
        if self._moves and self._clock.now_ns() - self._sent_ns > SILENT_S * NANOSECONDS:
            self._hold()
        return time_ms

    def _read(self, found: franky.RobotState, followed: bool) -> ArmState:
        mode = int(found.robot_mode.value)
        errors: tuple[str, ...] = ()
        if mode == REFLEX:
            flags = found.current_errors or found.last_motion_errors
            errors = tuple(name for name in ERRORS if getattr(flags, name))
        return ArmState(
            self._clock.now_ns(), found.q, found.dq, found.tau_J, mode, errors, followed, found
        )

    def _hold(self) -> None:
        """The control loop pauses in motion: without a velocity the arm stays at the target."""
        tracker, target, self._moves = self._tracker, self._target, False
        if tracker is not None and target is not None:
            tracker.set_target(target, NO_VELOCITY)

    def _note_end(self) -> None:
        """The arm has ended the motion: a reflex, the user stop, or the network."""
        self._tracker = None
        try:
            self._robot.poll_motion()
            self.ended = "the arm has ended the motion"
        except FAILURES as error:
            self.ended = str(error).removeprefix("libfranka: ")
        log.warning("motion ended by the arm", reason=self.ended)


def _connect(options: FrankaOptions) -> franky.Robot:
    config = franky.RealtimeConfig
    where = f"FCI at {options.address}"
    try:
        return connected(
            lambda: franky.Robot(
                options.address,
                realtime_config=config.Enforce if options.needs_realtime else config.Ignore,
            )
        )
    except franky.IncompatibleVersionException as error:
        text = f"{error}; install the franky-control wheel for the arm's system version"
        raise ConnectError("the arm has another version of FCI", {where: text}) from error
    except franky.RealtimeException as error:
        text = f"{error}; robotd doctor --backend franka names what is missing"
        raise ConnectError("this computer is not ready for FCI", {where: text}) from error
    except FAILURES as error:
        text = f"{error} (brakes open and FCI active in Desk? another client connected?)"
        raise ConnectError("the arm does not answer", {where: text}) from error


def connected(connect: Callable[[], Connection]) -> Connection:
    """Return the connection that ``connect`` makes, one of libfranka.

    Raises one of FAILURES, also after CONNECT_S; a connection that comes later is closed at once.
    """
    made: SimpleQueue[Connection | Exception] = SimpleQueue()

    def run() -> None:
        try:
            made.put(connect())
        except FAILURES as error:
            made.put(error)

    threading.Thread(target=run, name="franka-connect", daemon=True).start()
    try:
        found = made.get(timeout=CONNECT_S)
    except Empty:
        raise RuntimeError(f"no answer within {CONNECT_S:g} s") from None
    if isinstance(found, Exception):
        raise found
    return found


def _gains(options: FrankaOptions) -> tuple[FloatArray, FloatArray]:
    stiffness = np.array(options.stiffness)
    damping = options.damping
    return stiffness, 2.0 * np.sqrt(stiffness) if damping is None else np.array(damping)


def _why_not(state: ArmState | None) -> str:
    if state is None:
        return "no state from the arm yet"
    if state.mode == GUIDING:
        return "the arm is guided by hand: release the buttons at its flange"
    return alarm_of(state.mode, state.errors)[1] or "the arm moves already"
