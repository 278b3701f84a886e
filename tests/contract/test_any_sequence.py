"""Whatever is asked of an arm, and whatever happens to it: it never moves by surprise.

Sequences of commands, stops, faults and stalls on the simulation and a stepped clock, judged by
what the drives are commanded: a servo is on only by request, speed and acceleration stay within the
limits, nothing moves from the end of a stop to its reset, and in the end the arm recovers and
reaches a goal. Not judged: an axis without power, and a stop by the device itself.
"""

from __future__ import annotations

from contextlib import ExitStack, suppress
from random import Random
from typing import ClassVar

import numpy as np
import pytest
from tests.contract.sequences import FAULTS, Commands, Draw, Play, Witness, one_of
from tests.core.control.harness import ACCELERATION, Harness, arm

from robotd.control.groups.joint_stream import JointStream
from robotd.control.loop.setpoint_source import Outcome
from robotd.descriptor import RobotDescriptor
from robotd.device.axes import Jog, Move
from robotd.errors import RobotdError
from robotd.motion import TrajectoryRequest
from robotd.motion.profile import Profile

JOINTS = 3
VELOCITY = 3.0  # rad/s
HIGHEST = 3.1 * ACCELERATION  # a path between its points, and the way back to it after a stall


def positions(random: Random) -> list[float]:
    return [random.uniform(-0.9, 0.9) for _ in range(JOINTS)]


def profile(random: Random) -> Profile:
    ramps = random.uniform(1.0, ACCELERATION), random.uniform(1.0, ACCELERATION)
    return Profile(random.uniform(0.1, VELOCITY), *ramps)


PERIODS = one_of(1, 2, 5, 20, 100, 500)


def arm_commands(joints: int, positions: Draw) -> Commands:
    """Return the commands of an arm, to positions that ``positions`` draws."""

    def axis(random: Random) -> int:
        return random.randrange(joints)

    def axes(random: Random) -> list[int]:
        return random.sample(range(joints), random.randint(1, joints))

    def speeds(random: Random) -> list[float]:
        return [random.uniform(-4.0, 4.0) for _ in range(joints)]

    def points(random: Random) -> list[tuple[float, list[float]]]:
        count = random.randint(1, 4)
        return [(random.uniform(0.6, 2.0), positions(random)) for _ in range(count)]

    return {
        "step": (8, (PERIODS,)),
        "goal": (8, (points, PERIODS)),
        "cancel": (2, ()),
        "open": (2, (axes, one_of("target", "smooth"), one_of(0.05, 0.2, 1.0))),
        "send": (5, (positions, PERIODS)),
        "send_velocity": (3, (speeds, PERIODS)),
        "close": (1, ()),
        "move": (3, (axes, positions, profile, one_of(False, True))),
        "jog": (2, (axes, speeds, profile)),
        "mode": (2, (axis, one_of(0, 0, 1))),
        "servo": (1, (axis, one_of(False, True, True))),
        "clear_alarm": (0.5, (axis,)),
        "stop_axes": (1, (axes, one_of(False, True))),
        "stop": (1, ()),
        "reset": (2, ()),
        "pause": (0.5, ()),
        "resume": (1.5, ()),
        "speed": (1, (one_of(0.01, 0.1, 0.5, 1.0, 1.0),)),
        "recover": (1, ()),
        "bring_back": (6, ()),
        "disable": (0.3, ()),
        "stall": (1.5, (one_of(0.003, 0.01, 0.03, 0.1, 0.5, 2.0),)),
        "fault": (1, (one_of(*FAULTS, "thaw", "thaw"), axis)),
        "fault_later": (2, (one_of(*FAULTS, "latch", "latch"), axis, one_of(0.006, 0.08, 0.8))),
    }


COMMANDS = arm_commands(JOINTS, positions)


class ArmPlay(Play):
    """An arm, and what its clients hold."""

    witness_type: ClassVar[type[Witness]] = Witness

    def __init__(self, descriptor: RobotDescriptor) -> None:
        harness, joints = Harness(descriptor), len(descriptor.joints)
        fastest, hardest = np.full(joints, 1.1 * VELOCITY), np.full(joints, HIGHEST)
        super().__init__(harness, self.witness_type(harness, fastest, hardest))
        self.goals: list[ExitStack] = []
        self.streams: list[JointStream] = []

    def _goal(self, points: list[tuple[float, list[float]]], periods: int) -> None:
        times_s = np.cumsum([seconds for seconds, _ in points]).tolist()
        rows = [row for _, row in points]
        request = TrajectoryRequest.from_rows(self.robot.joint_names, times_s, rows)
        goal = ExitStack()
        goal.enter_context(self.robot.follower.follow(request))
        self.goals.append(goal)
        self._step(periods)

    def _cancel(self) -> None:
        if self.goals:
            self.goals.pop().close()

    def _open(self, axes: list[int], mode: str, timeout_s: float) -> None:
        names = [self.robot.joint_names[axis] for axis in axes]
        self.streams.append(self.robot.stream(names, mode=mode, timeout_s=timeout_s))

    def _send(self, values: list[float], periods: int) -> None:
        for stream in self.streams[-1:]:
            stream.send(values[: len(stream.joints)])
            self._step(periods)

    def _send_velocity(self, values: list[float], periods: int) -> None:
        for stream in self.streams[-1:]:
            stream.send_velocity(values[: len(stream.joints)])
            self._step(periods)

    def _close(self) -> None:
        if self.streams:
            self.streams.pop().close()

    def _move(self, axes: list[int], ends: list[float], how: Profile, relative: bool) -> None:
        self.robot.axes.move([Move(axis, ends[axis], how) for axis in axes], relative=relative)

    def _jog(self, axes: list[int], speeds: list[float], how: Profile) -> None:
        ramps = how.acceleration, how.deceleration
        self.robot.axes.jog([Jog(axis, Profile(speeds[axis], *ramps)) for axis in axes])

    def release(self) -> None:
        for goal in self.goals:
            goal.close()
        for stream in self.streams:
            stream.close()

    def set_modes(self) -> None:
        for axis in self._axes:
            with suppress(RobotdError):
                self.robot.axes.set_command_mode(axis, 0)

    def end(self) -> None:
        """Mend everything; the arm recovers, and reaches a goal."""
        self.mend()
        robot = self.robot
        target = np.where(robot.image.position_command > 0.0, -0.5, 0.5)
        request = TrajectoryRequest.from_rows(robot.joint_names, [5.0], [target.tolist()])
        with robot.follower.follow(request) as execution:
            self.harness.end(execution)
        assert execution.outcome is Outcome.SUCCEEDED, execution.message


@pytest.mark.parametrize("seed", range(25))
def test_it_never_moves_by_surprise(seed: int) -> None:
    ArmPlay(arm(JOINTS)).run(Random(seed), COMMANDS, 60)
