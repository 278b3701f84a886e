"""Stand-in for the library ``franky`` and for the arm behind it, in simulated time.

From the documentation of franky and libfranka: a loop in the library computes torques from each
state of the arm, one per millisecond; the arm repeats the last one for up to 20 lost packets, then
brakes and stays in a reflex; without states the library gives up after a second.

It does not model: gravity, friction, load and thresholds; gains and torques that change by and by;
FCI's limits of torque, velocity and acceleration; the user stop, Desk, and a second client.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any
from weakref import ref

import franky
import numpy as np

from robotd.api import FloatArray

JOINTS = 7
CYCLE_S = 0.001
MAX_LOST = 20  # packets in a row
TIMEOUT_S = 1.0  # of the library
POLL_S = 0.005
BRAKE_RAD_S2 = 10.0
END_S = 0.3  # of a motion that the client ends, at least
MAX_END_S = 2.0
INERTIA = np.array([1.0, 1.0, 1.0, 1.0, 0.4, 0.25, 0.1])  # kg·m², of each joint by itself
OTHER, IDLE, MOVE, REFLEX = 0, 1, 2, 4
LATE = "communication_constraints_violation"


@dataclass(frozen=True)
class Reference:
    """What the impedance controller follows.

    Attributes:
        position, velocity: (7,) rad and rad/s.
        sent_s: when it was set.
    """

    position: FloatArray
    velocity: FloatArray
    sent_s: float


class FrankaArm:
    """Control unit, arm, and the library's loop; ``advance`` lets them live up to the present.

    Args:
        now_s: simulated time.
        sleep: lets time pass.
        followed: called when the controller has a new reference: time, reference.

    Attributes:
        position, velocity: (7,) of the joints, rad and rad/s.
        stiffness, damping: (7,) of the controller.
        hand: (7,) torque of a hand, N·m.
        cut_s: no packet gets through until then.
        deaf_s: no packet gets to the arm until then.
        off_s: the control unit is off until then.
        busy: it rejects the next command.
    """

    def __init__(
        self,
        now_s: Callable[[], float],
        sleep: Callable[[float], None],
        position: FloatArray,
        followed: Callable[[float, Reference], None],
    ) -> None:
        self.now_s, self.sleep, self._followed = now_s, sleep, followed
        self.position, self.velocity = position.copy(), np.zeros(JOINTS)
        self.stiffness = self.damping = self.hand = np.zeros(JOINTS)
        self.cut_s = self.deaf_s = self.off_s = 0.0
        self.busy = False
        self.mode, self.errors = IDLE, frozenset[str]()
        self.reference: Reference | None = None  # of the controller, while it runs
        self._client: ref[FrankyRobot] | None = None
        self._known: Reference | None = None  # that the controller has followed
        self._ends_s: float | None = None  # when the end of the motion was asked for
        self._torque = np.zeros(JOINTS)
        self._lost = 0
        self._ran_s = now_s()

    @property
    def is_cut(self) -> bool:
        return self.now_s() < max(self.cut_s, self.off_s)

    @property
    def client(self) -> FrankyRobot | None:
        """The one client that is connected. Its object is the connection, as in the library."""
        return self._client() if self._client is not None else None

    @client.setter
    def client(self, client: FrankyRobot | None) -> None:
        self._client = ref(client) if client is not None else None

    @property
    def follows(self) -> bool:
        """The controller runs, and nobody has ended it."""
        return self.mode == MOVE and self._ends_s is None

    def advance(self) -> None:
        while self._ran_s + CYCLE_S <= self.now_s() + CYCLE_S / 2:
            self._ran_s += CYCLE_S
            self._cycle(self._ran_s)
        if self.client is not None:
            self.client.receive(lost=self.is_cut)

    def _cycle(self, time_s: float) -> None:
        cut = time_s < max(self.cut_s, self.off_s)
        self._lost = self._lost + 1 if cut or time_s < self.deaf_s else 0
        if self.mode == MOVE and self._lost > MAX_LOST:
            self.end_motion(LATE)
        if self.mode == MOVE and self._ends_s is None and self.reference is not None:
            if not cut and self.reference is not self._known:
                self._known = self.reference
                self._followed(time_s, self.reference)
            if not self._lost:
                error = self.reference.position - self.position
                self._torque = self.stiffness * error
                self._torque += self.damping * (self.reference.velocity - self.velocity)
            self.velocity += (self._torque + self.hand) / INERTIA * CYCLE_S
        elif self.velocity.any():
            most = BRAKE_RAD_S2 * CYCLE_S
            self.velocity -= np.clip(self.velocity, -most, most)
        self.position += self.velocity * CYCLE_S
        if self._ends_s is not None:
            elapsed_s = time_s - self._ends_s
            if elapsed_s > MAX_END_S or (elapsed_s > END_S and not self.velocity.any()):
                self.end_motion()

    def begin(self, stiffness: FloatArray, damping: FloatArray) -> None:
        """Start the controller at the measured position."""
        self.stiffness, self.damping = stiffness, damping
        self._known = self.reference = Reference(
            self.position.copy(), np.zeros(JOINTS), self.now_s()
        )
        self.mode, self._ends_s, self._torque = MOVE, None, np.zeros(JOINTS)

    def brake(self) -> None:
        """End the motion at rest."""
        if self.follows:
            self._ends_s = self.now_s()

    def end_motion(self, *errors: str) -> None:
        """End a motion; with errors the arm stays in a reflex."""
        self.reference, self._ends_s = None, None
        self.mode, self.errors = (REFLEX if errors else IDLE), frozenset(errors)

    def switch_off(self, until_s: float) -> None:
        """Let the control unit end all connections and be off, its arm at rest."""
        self.off_s = until_s
        self.disconnect()
        self.end_motion()
        self.velocity = np.zeros(JOINTS)

    def disconnect(self) -> None:
        """Let the connection of the client end."""
        if self.client is not None:
            self.client.lose("libfranka: the connection is closed")
            self.client = None
        if self.mode == MOVE:
            self.end_motion(LATE)

    def library(self) -> SimpleNamespace:
        """The module ``franky``, with this arm at every address."""
        names = {
            "Robot": lambda *_, **__: FrankyRobot(self),
            "JointImpedanceTracker": FrankyTracker,
        }
        return SimpleNamespace(**vars(franky) | names)


class FrankyRobot:
    """``franky.Robot``: what the backend uses of it."""

    def __init__(self, arm: FrankaArm) -> None:
        self.arm = arm
        if arm.is_cut or arm.client is not None:
            raise franky.NetworkException("libfranka: connection refused")
        self.is_in_control = False
        self._broken = self._failure = ""
        self._packet_s = arm.now_s()
        arm.client = self
        self._newest = self._snapshot()

    def __del__(self) -> None:
        if self.arm.client is None:  # it was this one
            self.arm.disconnect()

    def lose(self, why: str) -> None:
        self._broken = self._failure = why
        self.is_in_control = False

    def receive(self, *, lost: bool) -> None:
        """Take a state, or note that none has come."""
        arm = self.arm
        if lost:
            if arm.now_s() - self._packet_s > TIMEOUT_S:
                self.lose("libfranka: UDP receive: Timeout")
                arm.client = None
            return
        self._packet_s, self._newest = arm.now_s(), self._snapshot()
        if self.is_in_control and arm.mode != MOVE:
            self.is_in_control = False
            names = ", ".join(f'"{name}"' for name in sorted(arm.errors))
            if names:
                self._failure = f"libfranka: motion aborted by reflex! [{names}]"

    def _snapshot(self) -> Any:
        arm, time_ms = self.arm, round(self._packet_s * 1000)
        flags = SimpleNamespace(**dict.fromkeys(arm.errors, True))
        return SimpleNamespace(
            time=SimpleNamespace(to_msec=lambda: time_ms),
            q=arm.position.copy(), dq=arm.velocity.copy(), tau_J=np.zeros(JOINTS),
            robot_mode=SimpleNamespace(value=arm.mode),
            current_errors=Flags(flags), last_motion_errors=Flags(flags),
        )  # fmt: skip

    @property
    def state(self) -> Any:
        """The newest state; outside a motion of the next packet, for which this waits."""
        arm = self.arm
        arm.advance()
        while not self._broken and arm.is_cut and not self.is_in_control:
            arm.sleep(POLL_S)
            arm.advance()
        if self._broken:
            raise franky.NetworkException(self._broken)
        return self._newest

    def poll_motion(self) -> bool:
        failure, self._failure = self._failure, ""
        if failure:
            raise franky.ControlException(failure)
        return self.is_in_control

    def command(self, name: str) -> None:
        """Wait for the answer to a command. Raises an exception of the library: rejected."""
        arm = self.arm
        end_s = arm.now_s() + TIMEOUT_S
        while arm.is_cut and arm.now_s() < end_s and not self._broken:
            arm.sleep(POLL_S)
        if self._broken or arm.is_cut:
            raise franky.NetworkException(self._broken or "libfranka: TCP receive: Timeout")
        arm.sleep(CYCLE_S)
        busy, arm.busy = arm.busy, False
        if busy:
            raise franky.CommandException(f"libfranka: {name} command rejected")

    def recover_from_errors(self) -> bool:
        self.command("Automatic error recovery")
        if self.arm.mode == REFLEX:
            self.arm.end_motion()
        return True

    def set_load(self, *_: object) -> None:
        self._set("Set load")

    def set_collision_behavior(self, *_: object) -> None:
        self._set("Set collision behavior")

    def _set(self, name: str) -> None:
        self.command(name)
        if self.arm.mode == MOVE:
            raise franky.CommandException(f"libfranka: {name}: not possible in the mode Move")


class Flags:
    """Flags of errors; any that is not named is not set."""

    def __init__(self, flags: SimpleNamespace) -> None:
        self._flags = vars(flags)

    def __bool__(self) -> bool:
        return bool(self._flags)

    def __getattr__(self, name: str) -> bool:
        return name in self._flags


class FrankyTracker:
    """``franky.JointImpedanceTracker``."""

    def __init__(self, robot: FrankyRobot, *, stiffness: FloatArray, damping: FloatArray) -> None:
        self._robot, self._arm = robot, robot.arm
        robot.command("Move")
        if self._arm.mode != IDLE:
            raise franky.CommandException("libfranka: Move command rejected: in this mode")
        self._arm.begin(stiffness, damping)
        robot.is_in_control = True

    @property
    def _is_present(self) -> bool:
        return self._arm.client is self._robot and self._arm.reference is not None

    def set_target(self, position: FloatArray, velocity: FloatArray) -> None:
        if self._is_present:
            self._arm.reference = Reference(position.copy(), velocity.copy(), self._arm.now_s())

    def set_gains(self, *, stiffness: FloatArray, damping: FloatArray) -> None:
        if self._is_present:
            self._arm.stiffness, self._arm.damping = stiffness, damping

    def stop(self) -> None:
        robot = self._robot
        if robot.is_in_control:
            self._arm.brake()
        while robot.is_in_control:
            self._arm.sleep(POLL_S)
            self._arm.advance()
        robot.poll_motion()
