"""Whatever is asked of a base, and whatever happens to it: it never moves by surprise.

As for an arm. Wheels and twist stay within their limits; the base moves by commands of clients
only, comes to rest when they stay away, and after a stop or a fault each has to begin anew;
odometry is where the wheels have led. In the end the base recovers, and drives.
"""

from __future__ import annotations

import math
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from random import Random

import numpy as np
import pytest
from tests.contract.base_clock import BaseClock
from tests.contract.base_witness import BaseWitness
from tests.contract.sequences import FAULTS, Commands, Play, one_of
from tests.core.control.harness import Harness

from robotd.descriptor import RobotDescriptor, load_robot_descriptor
from robotd.device.axes import Jog, Move
from robotd.errors import InvalidArgument, RobotdError
from robotd.motion import TrajectoryRequest
from robotd.motion.planar import PlanarTwist
from robotd.motion.profile import Profile

KINDS = ("baymax", "mecanum_base", "skid_steer_base", "tricycle_base", "mobile_manipulator")
SECONDS = one_of(0.005, 0.01, 0.05, 0.2, 1.0)
CLIENT = one_of("cmd_vel", "cmd_vel", "page")
PLACE = Random.random  # of a wheel among all


def twist(random: Random) -> PlanarTwist:
    """Return a twist, sometimes far beyond all limits."""
    size = random.choice((0.3, 1.0, 1.0, 5.0))
    return random.choice((
        PlanarTwist(size * random.uniform(-1, 1), size * random.uniform(-2, 2)),
        PlanarTwist(size * random.uniform(-1, 1), size * random.uniform(-2, 2)),
        PlanarTwist(*(size * random.uniform(-1, 1) for _ in range(3))),
        PlanarTwist(size * random.uniform(-1, 1), 0.0),
        PlanarTwist(0.0, size * random.uniform(-2, 2)),
        PlanarTwist(0.0, 0.0),
    ))  # fmt: skip


def profile(random: Random) -> Profile:
    return Profile(random.uniform(-4.0, 4.0), random.uniform(2.0, 6.0), random.uniform(2.0, 6.0))


COMMANDS: Commands = {
    "wait": (6, (SECONDS,)),
    "send": (3, (CLIENT, twist, SECONDS)),
    "drive": (14, (CLIENT, twist, one_of(0.02, 0.05, 0.1, 0.4, 0.7), one_of(0.3, 3.0, 10.0, 20.0),
                   one_of(0.1, 0.5, 0.5, 1.0), one_of(0.0, 0.0, 0.0, 0.2), SECONDS)),
    "zero": (2, (CLIENT,)),
    "end_drive": (2, (CLIENT,)),
    "not_finite": (0.5, (CLIENT, one_of(0, 1, 2), one_of(math.nan, math.inf))),
    "goal": (2, (one_of(-0.4, 0.2, 0.4),)),
    "move": (0.7, (PLACE, one_of(-0.5, 0.5), profile)),
    "jog": (2, (PLACE, profile)),
    "wheel_mode": (1, (PLACE, one_of(0, 1, 1))),
    "wheel_servo": (1, (PLACE, one_of(False, True, True))),
    "stop_wheel": (1, (PLACE, one_of(False, True))),
    "stop": (1, ()),
    "reset": (2, ()),
    "pause": (0.5, ()),
    "resume": (1.5, ()),
    "speed": (1, (one_of(0.0, 0.1, 0.5, 1.0, 1.0, 1.0),)),
    "recover": (1, ()),
    "bring_back": (5, ()),
    "disable": (0.3, ()),
    "odometry": (0.5, ()),
    "stall": (1.5, (one_of(0.003, 0.01, 0.03, 0.1, 0.5, 2.0),)),
    "overrun": (1.5, (one_of(0.003, 0.01, 0.03, 0.1, 0.5), one_of(0.005, 0.1, 0.5))),
    "wheel_fault": (1, (one_of(*FAULTS, "thaw", "thaw"), PLACE, one_of(0.0))),
    "wheel_fault_later": (2, (one_of(*FAULTS, "latch", "latch"), PLACE, one_of(0.01, 0.1, 1.0))),
}  # fmt: skip


@dataclass
class Drive:
    """Commands of a client, sent every ``interval_s`` until ``end_s``."""

    twist: PlanarTwist
    interval_s: float
    end_s: float
    timeout_s: float = 0.5
    age_s: float = 0.0
    due_s: float = 0.0


class BasePlay(Play):
    """A base, and its clients."""

    def __init__(self, descriptor: RobotDescriptor) -> None:
        clock = BaseClock()
        harness = Harness(descriptor, clock)
        self.judge = BaseWitness(harness)
        super().__init__(harness, self.judge)
        self.base, self._wheels = self.judge.base, descriptor.drive.axes  # type: ignore[union-attr]
        self.drives: dict[str, Drive] = {}
        self.goals: list[ExitStack] = []
        clock.guide(harness.robot)
        clock.before_period = self._send_due

    def _axis(self, place: float) -> int:
        return self._wheels[int(place * len(self._wheels))]

    def _send_due(self) -> None:
        now_s = self.harness.now_s
        self.drives = {name: drive for name, drive in self.drives.items() if now_s < drive.end_s}
        for name, drive in self.drives.items():
            if now_s >= drive.due_s:
                drive.due_s = now_s + drive.interval_s
                with suppress(RobotdError):
                    self.judge.hear(name, drive.twist, now_s - drive.age_s, drive.timeout_s)

    def _wait(self, seconds: float) -> None:
        self.harness.run(seconds)

    def _send(self, client: str, twist: PlanarTwist, seconds: float) -> None:
        self.judge.hear(client, twist, self.harness.now_s, 0.5)
        self._wait(seconds)

    def _drive(
        self,
        client: str,
        twist: PlanarTwist,
        interval_s: float,
        duration_s: float,
        timeout_s: float,
        age_s: float,
        seconds: float,
    ) -> None:
        end_s = self.harness.now_s + duration_s
        self.drives[client] = Drive(twist, interval_s, end_s, timeout_s, age_s)
        self._wait(seconds)

    def _zero(self, client: str) -> None:
        self._send(client, PlanarTwist(0.0, 0.0), 0.0)

    def _end_drive(self, client: str) -> None:
        self.drives.pop(client, None)

    def _not_finite(self, client: str, place: int, value: float) -> None:
        parts = [0.1, 0.1, 0.0]
        parts[place] = value
        with pytest.raises(InvalidArgument):
            self._send(client, PlanarTwist(*parts), 0.0)

    def _goal(self, target: float) -> None:
        names = self.robot.joint_names
        if names:
            request = TrajectoryRequest.from_rows(names, [2.0], [[target] * len(names)])
            goal = ExitStack()
            goal.enter_context(self.robot.follower.follow(request))
            self.goals.append(goal)

    def _move(self, place: float, distance: float, how: Profile) -> None:
        speed = Profile(max(0.1, abs(how.velocity) / 4), how.acceleration, how.deceleration)
        self.robot.axes.move([Move(self._axis(place), distance, speed)], relative=True)

    def _jog(self, place: float, how: Profile) -> None:
        self.robot.axes.jog([Jog(self._axis(place), how)])
        self._wait(0.1)

    def _wheel_mode(self, place: float, mode: int) -> None:
        self._mode(self._axis(place), mode)

    def _wheel_servo(self, place: float, on: bool) -> None:
        self._servo(self._axis(place), on)

    def _stop_wheel(self, place: float, quick: bool) -> None:
        if self.base.moving:
            self.judge.interrupt()
        self._stop_axes([self._axis(place)], quick)

    def _odometry(self) -> None:
        self.base.reset_odometry()
        self.judge.forget_pose()

    def _stall(self, seconds: float) -> None:
        self.judge.longest_stall_s = max(self.judge.longest_stall_s, seconds)
        super()._stall(seconds)

    def _overrun(self, seconds: float, delay_s: float) -> None:
        """Let a period take longer, before its setpoints."""
        self.judge.longest_stall_s = max(self.judge.longest_stall_s, seconds)
        self.later(delay_s, lambda: self.robot.control_loop.delay(seconds))

    def _wheel_fault(self, name: str, place: float, seconds: float) -> None:
        self._fault(name, self._axis(place))

    def _wheel_fault_later(self, name: str, place: float, seconds: float) -> None:
        self._fault_later(name, self._axis(place), seconds)

    def release(self) -> None:
        self.drives.clear()
        for goal in self.goals:
            goal.close()

    def set_modes(self) -> None:
        for axis, mode in zip(self._wheels, self.base._modes, strict=True):
            with suppress(RobotdError):
                self.robot.axes.set_command_mode(axis, mode)

    def end(self) -> None:
        """Mend everything; the base recovers, and drives."""
        self.mend()
        self._wait(1.0)
        left = 0.1 if self.base.wheels.moves_sideways else 0.0
        twist = PlanarTwist(0.2, 0.15, left)
        self.drives["cmd_vel"] = Drive(twist, 0.05, self.harness.now_s + 3.0)
        self._wait(3.0)
        assert self.base.twist(self.robot.image) == pytest.approx(twist, abs=3e-3)
        self._wait(3.0)
        assert np.abs(self.robot.image.velocity).max() < 1e-3


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", KINDS)
def test_a_base_never_moves_by_surprise(kind: str, seed: int) -> None:
    BasePlay(load_robot_descriptor(kind)).run(Random(f"{kind} {seed}"), COMMANDS, 30)
