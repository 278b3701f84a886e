"""The backend ``franka`` on a stand-in for its library and its arm, in simulated time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from unittest.mock import patch

import numpy as np
from tests.witness.bench import TRAJECTORY, Bench
from tests.witness.franka_arm import JOINTS, POLL_S, FrankaArm, Reference
from tests.witness.judge import REST_RAD_S, Command, Judge
from tests.witness.servo_clock import ServoClock

from robotd.api import FloatArray
from robotd.clock import NANOSECONDS
from robotd.descriptor import load_robot_descriptor, parse_override
from robotd.device.capabilities import Capability
from robotd.motion.profile import Profile
from robotd.plugin.manager import load_backend
from robotd.robot import Robot

MIDDLE = (0.0, 0.0, 0.0, -1.6, 0.0, 2.0, 0.0)  # of the joints, rad; about that of their ranges
MAX_VELOCITY_AGE_S = 0.04  # of a reference that moves: a silence, and a look of the state's thread
QUICK_STOP_RAD_S2, QUICK_STOP_S = 10.0, 0.3
MISSED_S = 0.008  # of lost packets, which the arm bridges by its last torque: no silence yet
OFF_S = 0.5
STIFF = np.full(JOINTS, np.inf)
SOFT = 30.0  # N·m/rad: below it a hand moves a joint
HAND_NM = 4.0


class FrankaBench(Bench):
    """A robot that is not yet started; ``close`` when it is not needed any more.

    The judge is at the impedance controller: each reference that it follows, how long it follows
    one that moves, and how far the joint is from it where stiffness returns.
    """

    clock: ServoClock
    has_hands = True
    bent_joints = (0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785)
    middle, seconds_per_rad, profile = MIDDLE, 1.5, Profile(1.5, 2.0, 2.0)

    def __init__(self, rate_hz: float = 100.0) -> None:
        self.prepare(JOINTS, rate_hz, base=False)
        self.clock = ServoClock()
        self.arm = FrankaArm(lambda: self.now_s, self._sleep, np.array(MIDDLE), self._follow)
        self._places: FloatArray | None = None  # of the reference before; None: it has begun
        self._stiffness: FloatArray = STIFF  # with the reference before
        self._caught = set[int]()  # joints that were led, and have no place yet
        self._hand: tuple[int, float] | None = None  # joint, and where it is led to
        self._ends: list[tuple[float, Callable[[], None]]] = []  # of faults
        keys = {"backend": "franka", "cycle.rate_hz": rate_hz, "engine.open_tries": 1,
                "engine.servo_timeout_s": 1.0, "backends.franka.address": "arm",
                "trajectory.acceleration_margin": TRAJECTORY["acceleration_margin"]}  # fmt: skip
        overrides = [parse_override(f"{key}={value}") for key, value in keys.items()]
        self._descriptor = load_robot_descriptor("fr3", overrides=overrides)
        for judge, joint in zip(self.judges, self._descriptor.joints, strict=True):
            judge.velocity, judge.acceleration = joint.velocity, joint.acceleration
            judge.lower, judge.upper = joint.lower, joint.upper
            judge.coast_s = 1.0 / rate_hz + MISSED_S
        self._patches = ExitStack()
        modules = {"franky": self.arm.library(), "threading": self.clock.threading}
        # This arm answers at once, and time stands still meanwhile: there is nothing to wait for.
        others = {"POLL_S": POLL_S, "connected": lambda connect: connect()}
        for name, value in {**modules, **others}.items():
            self._patches.enter_context(patch(f"robotd_franka.arm_link.{name}", value))
        self.clock.advanced = self.settle
        self.robot = self.make_robot()

    def _sleep(self, seconds: float) -> None:
        self.clock.sleep_until_ns(self.clock.now_ns() + round(seconds * NANOSECONDS))

    def make_robot(self) -> Robot:
        backend = load_backend("franka")
        backend.capabilities |= {Capability.SIMULATED}  # here: the arm uses this clock
        return Robot(self._descriptor, backend, self.clock)

    def close(self) -> None:
        self.clock.kill_bus()
        self._patches.close()

    def unplug(self) -> None:
        self.clock.kill_bus()
        self.arm.disconnect()

    def settle(self) -> None:
        """Let the arm live up to the present, and faults end."""
        for end in [end for end in self._ends if end[0] <= self.now_s]:
            self._ends.remove(end)
            end[1]()
        self._lead()
        self.arm.advance()
        self._power()
        reference = self.arm.reference if self.arm.follows else None
        if reference is not None and self.now_s - reference.sent_s > MAX_VELOCITY_AGE_S:
            for judge, speed in zip(self.judges, reference.velocity, strict=True):
                if speed and not self.arm.is_cut:
                    judge.findings.append(
                        f"{self.now_s:.3f} s: {judge.name} follows {speed:+.2f} rad/s of "
                        f"{self.now_s - reference.sent_s:.3f} s ago"
                    )

    def _power(self) -> None:
        on = self.arm.follows
        if not on:
            self._places, self._stiffness = None, STIFF
            self._caught.clear()
        for judge in self.judges:
            judge.power(self.now_s, on)

    def _follow(self, time_s: float, reference: Reference) -> None:
        """Judge a reference that the controller follows from now on."""
        arm = self.arm
        self._power()
        before = arm.position if self._places is None else self._places
        self._places = reference.position
        for axis, judge in enumerate(self.judges):
            target, place = float(reference.position[axis]), float(before[axis])
            if arm.stiffness[axis] < SOFT:
                judge.own_ramp()  # it follows the joint
                continue
            if self._stiffness[axis] < SOFT:
                self._caught.add(axis)
            if axis in self._caught:  # it is held where it comes to rest
                judge.seed(Command(time_s, target, place=float(arm.position[axis])))
                self._require_still(judge, time_s, float(reference.velocity[axis]))
                if abs(arm.velocity[axis]) < REST_RAD_S:
                    self._caught.discard(axis)
            else:
                judge.execute(Command(time_s, target, sent_s=reference.sent_s, place=place))
            judge.profile(time_s, float(reference.velocity[axis]))
        self._stiffness = arm.stiffness

    @staticmethod
    def _require_still(judge: Judge, time_s: float, speed: float) -> None:
        """Judge the velocity of a reference for a joint that is to come to rest by its damping."""
        if abs(speed) > REST_RAD_S:
            judge.findings.append(f"{time_s:.3f} s: {judge.name} is led on with {speed:+.2f} rad/s")

    # Faults

    def _until(self, seconds: float) -> float:
        self.is_cut = True  # the arm holds itself, and robotd cannot know
        self.allow_ramp(QUICK_STOP_RAD_S2, seconds + QUICK_STOP_S)
        return self.now_s + seconds

    def silence(self, seconds: float, axes: Sequence[int] = (), how: str = "both") -> None:
        """Lose packets: all; or those to the arm, which are torques of the controller."""
        if how == "commands":
            self.arm.deaf_s = self._until(seconds)
        else:  # the controller computes nothing without states
            self.arm.cut_s = self._until(seconds)

    def delay(self, seconds: float, delay_s: float, axes: Sequence[int] = ()) -> None:
        """Let packets to the arm come too late: it discards them."""
        self.arm.deaf_s = self._until(seconds)

    def block(self, seconds: float) -> None:
        self.arm.deaf_s = self._until(seconds)

    def cut_cable(self, seconds: float) -> None:
        self.arm.cut_s = self._until(seconds)

    def reset(self, axis: int) -> None:
        """Let the control unit restart."""
        self.arm.switch_off(self._until(OFF_S))

    def trip(self, axis: int) -> None:
        self.arm.end_motion("joint_reflex")

    def refuse(self, axis: int) -> None:
        """Let the arm reject the next command."""
        self.arm.busy = True

    def push(self, axis: int, displacement: float) -> None:
        end = float(self.arm.position[axis]) + displacement
        middle = MIDDLE[axis]
        self._hand = axis, max(middle - 1.2, min(middle + 1.2, end))

    def _lead(self) -> None:
        """Let the hand lead a joint without stiffness; it lets go where it is held."""
        arm = self.arm
        arm.hand = np.zeros(JOINTS)
        if self._hand is None:
            return
        axis, end = self._hand
        displacement = end - float(arm.position[axis])
        if not arm.follows or arm.stiffness[axis] >= SOFT or abs(displacement) < 0.01:
            self._hand = None
        else:
            arm.hand[axis] = HAND_NM * np.clip(10.0 * displacement, -1.0, 1.0)

    def heal(self) -> None:
        arm = self.arm
        arm.cut_s = arm.deaf_s = 0.0
        arm.off_s = min(arm.off_s, self.now_s)
        arm.busy = self.is_cut = False
        self._hand = None
        for _, end in self._ends:
            end()
        self._ends.clear()
