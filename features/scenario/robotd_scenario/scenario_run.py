"""Executes a scenario on its own robot: one thread, simulated time, no ROS."""

from __future__ import annotations

import hashlib
import math
import struct
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from robotd.api import NANOSECONDS, NotReady, ProcessImage, RobotdError, RobotDescriptor, wait_until
from robotd.api.robots import Backend, Outcome, Robot, SteppedClock, TrajectoryRequest
from robotd_scenario.fault_schedule import FaultSchedule, Happened
from robotd_scenario.program import (
    Check,
    Expected,
    Fingers,
    MoveStep,
    Scenario,
    ScenarioStep,
    Switch,
    TrajectoryStep,
    unmet,
)

MOTION_TIMEOUT_S = 3600.0

_OUTCOMES = {
    Outcome.SUCCEEDED: Expected.OK,
    Outcome.PATH_TOLERANCE: Expected.PATH_TOLERANCE,
    Outcome.GOAL_TOLERANCE: Expected.GOAL_TOLERANCE,
}


@dataclass(frozen=True)
class StepDone:
    """A completed step.

    Attributes:
        time_s: simulated seconds after the program began.
        failure: why it failed; None: the outcome is as expected.
    """

    step: ScenarioStep
    time_s: float
    failure: str | None = None


@dataclass
class Result:
    """Result of a scenario.

    Attributes:
        failures: unmet expectations; empty: it passed.
        faults: injected and removed faults, in order.
        simulated_s, real_s: duration of the program.
        periods, digest: how many periods were recorded, and the SHA-256 of all their joint
            states: positions, commands, velocities and torques of all axes, and the fingers.
    """

    failures: list[str] = field(default_factory=list)
    faults: list[Happened] = field(default_factory=list)
    simulated_s: float = 0.0
    real_s: float = 0.0
    periods: int = 0
    digest: str = ""


class ScenarioRun:
    """One run. Call ``steps`` once, in one thread; ``result`` is complete when it ends.

    Args:
        scenario: faults, commands and checks.
        descriptor: the robot; the scenario's options override its own.
        backend: a simulated one.
        scale: simulated seconds per second; infinity: as fast as possible.
    """

    def __init__(
        self,
        scenario: Scenario,
        descriptor: RobotDescriptor,
        backend: Backend,
        scale: float = math.inf,
    ) -> None:
        self.result = Result()
        self._scenario = scenario
        self._robot = Robot(scenario.lay_over(descriptor), backend, SteppedClock(scale))
        self._clock = self._robot.clock
        self._begin_ns = 0
        self._hash = hashlib.sha256()

    def steps(self) -> Iterator[StepDone]:
        """Execute the program; yield each step when it ends, stop after the first failure.

        Raises:
            InvalidArgument: a fault does not fit the robot; nothing was opened.
            RobotdError: the robot did not start.
        """
        robot, result = self._robot, self.result
        schedule = FaultSchedule(robot, self._scenario.faults)
        robot.control_loop.every(robot.descriptor.cycle.rate_hz, "record", self._record)
        try:
            robot.start()
            schedule.begin()
            begin_s, self._begin_ns = time.monotonic(), self._clock.now_ns()
            yield from self._do_all(self._scenario.program)
            result.real_s = time.monotonic() - begin_s
            result.simulated_s = self._passed_s()
            result.faults = schedule.happened
            result.failures += schedule.failures()
        finally:
            result.digest = self._hash.hexdigest()
            robot.shutdown()

    def _do_all(self, steps: tuple[ScenarioStep, ...]) -> Iterator[StepDone]:
        for step in steps:
            if step.repeat is not None:
                for _ in range(step.repeat.times):
                    yield from self._do_all(step.repeat.program)
                    if self.result.failures:
                        return
                continue
            failure = self._do(step)
            if failure is not None:
                self.result.failures.append(f"{step}: {failure}")
            yield StepDone(step, self._passed_s(), failure)
            if failure is not None:
                return

    def _do(self, step: ScenarioStep) -> str | None:
        """Execute one step; return why it failed, None on success."""
        if step.wait_s is not None:
            self._wait(step.wait_s)
            return None
        if step.check is not None:
            return self._check(step.check)
        ending, reason = self._command(step)
        if ending is not step.expect:
            return f"expected {step.expect}, got {ending}" + (f": {reason}" if reason else "")
        if step.reason not in reason:
            return f"the reason {reason!r} does not contain {step.reason!r}"
        return None

    def _command(self, step: ScenarioStep) -> tuple[Expected, str]:
        if step.move is not None:
            return self._follow(partial(self._move, step.move))
        if step.trajectory is not None:
            return self._follow(partial(_request, step.trajectory))
        if step.gripper is not None:
            return _attempt(partial(self._grip, step.gripper))
        if step.servos is not None:
            return _attempt(partial(self._switch, step.servos))
        return _attempt(partial(self._run_engine, step.engine))

    def _follow(self, make: Callable[[], TrajectoryRequest]) -> tuple[Expected, str]:
        try:
            request = make()
            follower = self._robot.groups.of(request.joint_names).follower
            with follower.follow(request) as execution:
                if not wait_until(lambda: execution.done, MOTION_TIMEOUT_S, self._clock):
                    return Expected.FAULT, f"not finished after {MOTION_TIMEOUT_S:g} s"
        except RobotdError as error:
            return Expected.REJECTED, str(error)
        outcome = execution.outcome or Outcome.FAULT
        return _OUTCOMES.get(outcome, Expected.FAULT), execution.message

    def _move(self, move: MoveStep) -> TrajectoryRequest:
        robot, group = self._robot, self._robot.groups.of(move.to_rad)
        stay = robot.image.position_command[list(group.joint_axes)]
        targets = {**dict(zip(group.joint_names, stay.tolist(), strict=True)), **move.to_rad}
        positions = np.array([list(targets.values())])
        return TrajectoryRequest(tuple(targets), np.array([move.time_s]), positions)

    def _grip(self, fingers: Fingers) -> None:
        if self._robot.gripper is None:
            raise NotReady(f"{self._robot.descriptor.name} has no gripper")
        self._robot.gripper.command(fingers is Fingers.CLOSED)

    def _switch(self, switch: Switch) -> None:
        if switch is Switch.ON:
            self._robot.servos.enable()
            return
        results = self._robot.axes.servos_off(self._robot.servos.used)
        for failure in filter(None, results.values()):
            raise failure

    def _run_engine(self, switch: Switch | None) -> None:
        if switch is Switch.OFF:
            self._robot.connection.stop_communication()
        else:
            self._robot.connection.start()

    def _check(self, check: Check) -> str | None:
        wait_until(lambda: unmet(check, self._robot) is None, check.within_s, self._clock)
        return unmet(check, self._robot)

    def _wait(self, seconds: float) -> None:
        self._clock.sleep_until_ns(self._clock.now_ns() + round(seconds * NANOSECONDS))

    def _passed_s(self) -> float:
        return (self._clock.now_ns() - self._begin_ns) / NANOSECONDS

    def _record(self, image: ProcessImage) -> None:
        self.result.periods += 1
        for values in (image.position, image.position_command, image.velocity, image.torque):
            self._hash.update(values.tobytes())
        if self._robot.gripper is not None:
            self._hash.update(struct.pack("d", self._robot.gripper.closed))


def _request(trajectory: TrajectoryStep) -> TrajectoryRequest:
    return TrajectoryRequest(
        trajectory.joints,
        np.array([point.at_s for point in trajectory.points]),
        np.array([point.positions_rad for point in trajectory.points]),
    )


def _attempt(command: Callable[[], None]) -> tuple[Expected, str]:
    try:
        command()
    except RobotdError as error:
        return Expected.REJECTED, str(error)
    return Expected.OK, ""
