"""Whatever is asked of an arm, and whatever happens to it: it never moves by surprise.

Sequences of commands, stops, faults and stalls on the simulation and a stepped clock, judged by
what the drives are commanded: a servo is on only by request, speed and acceleration stay within the
limits, nothing moves from the end of a stop to its reset, and in the end the arm recovers and
reaches a goal. Not judged: an axis without power, and a stop by the device itself.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, suppress
from random import Random
from typing import Any

import numpy as np
import pytest
from tests.core.control.harness import ACCELERATION, PERIOD_S, Harness, arm

from robotd.api import FloatArray
from robotd.control.completion import Outcome
from robotd.control.joint_stream import JointStream
from robotd.device.axes import Jog, Move
from robotd.device.process_image import ProcessImage
from robotd.errors import RobotdError
from robotd.motion import TrajectoryRequest
from robotd.motion.profile import Profile

JOINTS = 3
VELOCITY = 3.0  # rad/s
HIGHEST = 3.1 * ACCELERATION  # a path between its points, and the way back to it after a stall
COASTING = 250  # periods until an axis without power is at rest
STOPPING = 50  # periods of a quick stop
RENUMBERED = 3  # periods in which a restarted encoder may count anew


def axis(random: Random) -> int:
    return random.randrange(JOINTS)


def axes(random: Random) -> list[int]:
    return random.sample(range(JOINTS), random.randint(1, JOINTS))


def positions(random: Random) -> list[float]:
    return [random.uniform(-0.9, 0.9) for _ in range(JOINTS)]


def speeds(random: Random) -> list[float]:
    return [random.uniform(-4.0, 4.0) for _ in range(JOINTS)]


def profile(random: Random) -> Profile:
    ramps = random.uniform(1.0, ACCELERATION), random.uniform(1.0, ACCELERATION)
    return Profile(random.uniform(0.1, VELOCITY), *ramps)


def points(random: Random) -> list[tuple[float, list[float]]]:
    return [(random.uniform(0.6, 2.0), positions(random)) for _ in range(random.randint(1, 4))]


def one_of(*values: Any) -> Callable[[Random], Any]:
    return lambda random: random.choice(values)


PERIODS = one_of(1, 2, 5, 20, 100, 500)
FAULTS = ("trip", "disconnect", "freeze", "lose", "turn", "drop_communication", "stop_engine")

# Command of ``Play``: how often it comes, and what draws its arguments.
COMMANDS: dict[str, tuple[float, tuple[Callable[[Random], Any], ...]]] = {
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
    "fault_later": (2, (one_of(*FAULTS, "latch", "latch"), axis, one_of(3, 40, 400))),
}


class Witness:
    """Judges the true motion once a period, in the control loop."""

    def __init__(self, harness: Harness) -> None:
        self._harness, self._simulation = harness, harness.simulation
        self.may_enable = self.is_stopped = False
        self.excused = np.zeros(JOINTS, int)  # periods in which an axis is not judged
        self.seen: list[str] = []
        self._engine: object = None
        self._time_ns = harness.clock.now_ns()
        self._was_on: list[bool] = [False] * JOINTS
        self._position = self._command
        self._velocity: FloatArray | None = None  # of the period before; None: after a gap

    def excuse(self, periods: int) -> None:
        self.excused = np.maximum(self.excused, periods)

    def look(self, image: ProcessImage | None = None) -> None:
        simulation, now_ns = self._simulation, self._harness.clock.now_ns()
        on = [bool(simulation.states.servo_on[axis]) for axis in range(JOINTS)]
        position, elapsed_s = self._command, (now_ns - self._time_ns) / 1e9
        if simulation.engine is not self._engine:
            self._engine = simulation.engine
            self.excuse(RENUMBERED)
        for axis in range(JOINTS):
            if not on[axis]:
                self.excused[axis] = max(self.excused[axis], COASTING)
            elif not self._was_on[axis] and not self.may_enable:
                self.seen.append(f"axis {axis} is switched on")
        velocity = None
        if 0.0 < elapsed_s < 1.5 * PERIOD_S:
            velocity = (position - self._position) / elapsed_s
            before = velocity if self._velocity is None else self._velocity
            for axis in range(JOINTS):
                self._judge(axis, velocity[axis], (velocity - before)[axis] / elapsed_s)
        self._velocity = velocity
        self.excused = np.maximum(self.excused - 1, 0)
        self._was_on, self._position, self._time_ns = on, position, now_ns

    def _judge(self, axis: int, velocity: float, acceleration: float) -> None:
        if self.excused[axis]:
            return
        if self.is_stopped and abs(velocity) > 0.05:
            self.seen.append(f"axis {axis} moves with {velocity:.2f} rad/s after a stop")
        if abs(velocity) > 1.1 * VELOCITY:
            self.seen.append(f"axis {axis} moves with {velocity:.2f} rad/s")
        if abs(acceleration) > HIGHEST:
            self.seen.append(f"axis {axis} changes its speed by {acceleration:.0f} rad/s²")

    @property
    def _command(self) -> FloatArray:
        return np.array(self._simulation.servo.command[:JOINTS], float)


class Play:
    """An arm, its witness, and what its clients hold."""

    def __init__(self) -> None:
        self.harness = Harness(arm(JOINTS))
        self.robot, self.witness = self.harness.robot, Witness(self.harness)
        self.goals: list[ExitStack] = []
        self.streams: list[JointStream] = []
        self._later: list[tuple[int, Callable[[], None]]] = []
        self.robot.control_loop.every(1.0 / PERIOD_S, "play", self._run_due, first=True)
        self.robot.control_loop.every(1.0 / PERIOD_S, "witness", self.witness.look)

    def requested(self, action: Callable[[], object]) -> None:
        """Run what may switch servos on."""
        self.witness.may_enable = True
        try:
            action()
        finally:
            self.witness.may_enable = False

    def do(self, name: str, *arguments: Any) -> None:
        getattr(self, f"_{name}")(*arguments)

    def _run_due(self, image: ProcessImage) -> None:
        now_ns = self.harness.clock.now_ns()
        due = [each for each in self._later if each[0] <= now_ns]
        self._later = [each for each in self._later if each[0] > now_ns]
        for _, action in due:
            with suppress(RobotdError):
                action()

    def _step(self, periods: int) -> None:
        self.robot.step(periods)

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

    def _mode(self, axis: int, mode: int) -> None:
        self.robot.axes.set_command_mode(axis, mode)

    def _servo(self, axis: int, on: bool) -> None:
        if on:
            self.requested(lambda: self.robot.axes.servo(axis, True))
        else:
            self.robot.axes.servo(axis, False)

    def _clear_alarm(self, axis: int) -> None:
        self.robot.axes.clear_alarm(axis)

    def _stop_axes(self, axes: list[int], quick: bool) -> None:
        if quick:
            self.witness.excuse(STOPPING)  # by the deceleration of the device's parameters
        (self.robot.axes.quick_stop if quick else self.robot.axes.stop)(axes)

    def _stop(self) -> None:
        self.robot.stop()
        self.witness.is_stopped = True

    def _reset(self) -> None:
        self.robot.reset()
        self.witness.is_stopped = False

    def _pause(self) -> None:
        self.robot.pause()

    def _resume(self) -> None:
        self.robot.resume()

    def _speed(self, speed: float) -> None:
        self.robot.set_speed(speed)

    def _recover(self) -> None:
        self.requested(self.robot.recover)

    def _bring_back(self) -> None:
        """Do all that an operator can, so that what follows moves something."""
        for action in (self._resume, self._reset, self._recover):
            with suppress(RobotdError):
                action()
        for axis in range(JOINTS):
            with suppress(RobotdError):
                self.robot.axes.set_command_mode(axis, 0)

    def _disable(self) -> None:
        self.robot.servos.disable()

    def _stall(self, seconds: float) -> None:
        self.harness.stall(seconds)
        if seconds > 0.2:
            self.witness.excuse(STOPPING)  # the device has stopped by itself

    def _fault_later(self, name: str, axis: int, periods: int) -> None:
        due_ns = self.harness.clock.now_ns() + round(periods * PERIOD_S * 1e9)
        self._later.append((due_ns, lambda: self._fault(name, axis)))

    def _fault(self, name: str, axis: int) -> None:
        faults = self.harness.faults
        match name:
            case "trip":
                faults.trip(axis, 0x7305)
            case "disconnect":
                faults.disconnect(axis)
            case "freeze" | "thaw":
                faults.freeze(name == "freeze")
            case "lose":
                faults.lose_packets(10)
            case "turn":
                faults.move_by_hand(axis, 0.3)
            case "latch":
                self.robot.axes.stop_latch.engage("by the operator")
            case _:
                getattr(faults, name)()

    def end(self) -> None:
        """Mend everything; the arm recovers, and reaches a goal."""
        robot, faults = self.robot, self.harness.faults
        self._later.clear()
        faults.freeze(False)
        for axis in range(JOINTS):
            faults.reconnect(axis)
        with suppress(RobotdError):
            robot.fieldbus.start_hot_connect(0)
        for goal in self.goals:
            goal.close()
        for stream in self.streams:
            stream.close()
        robot.resume()
        robot.set_speed(1.0)
        robot.step(500)
        self.witness.is_stopped = False
        robot.reset()
        self.requested(robot.recover)
        robot.axes.stop_and_wait(range(JOINTS), 20.0)
        for axis in range(JOINTS):
            robot.axes.set_command_mode(axis, 0)
        target = np.where(robot.image.position_command > 0.0, -0.5, 0.5)
        request = TrajectoryRequest.from_rows(robot.joint_names, [5.0], [target.tolist()])
        with robot.follower.follow(request) as execution:
            self.harness.end(execution)
        assert execution.outcome is Outcome.SUCCEEDED, execution.message


@pytest.mark.parametrize("seed", range(25))
def test_it_never_moves_by_surprise(seed: int) -> None:
    random, play = Random(seed), Play()
    weights = [weight for weight, _ in COMMANDS.values()]
    try:
        play.requested(play.robot.start)
        for name in random.choices(tuple(COMMANDS), weights, k=60):
            arguments = [draw(random) for draw in COMMANDS[name][1]]
            with suppress(RobotdError):
                play.do(name, *arguments)
            assert not play.witness.seen, (name, arguments)
        play.end()
    finally:
        play.robot.shutdown()
    play.witness.look()
    assert not play.witness.seen
    assert not play.harness.simulation.states.servo_on.any()
