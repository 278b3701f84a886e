"""Random sequences of commands, stops, faults and stalls on the simulation, and their judge."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from random import Random
from typing import Any

import numpy as np
from tests.core.control.harness import Harness

from robotd.api import FloatArray
from robotd.device.process_image import ProcessImage
from robotd.errors import RobotdError

COASTING_S = 0.5  # until an axis without power is at rest
STOPPING_S = 0.1  # of a quick stop
RENUMBERED = 3  # periods in which a restarted encoder may count anew
STOPPED_RAD_S = 0.05  # highest speed after a stop
FAULTS = ("trip", "disconnect", "freeze", "lose", "turn", "drop_communication", "stop_engine")

Draw = Callable[[Random], Any]
Commands = Mapping[str, tuple[float, tuple[Draw, ...]]]
"""Command of ``Play``: how often it comes, and what draws its arguments."""


def one_of(*values: Any) -> Draw:
    return lambda random: random.choice(values)


class Witness:
    """Judges the true motion once a period, in the control loop.

    Args:
        velocity, acceleration: highest values of each axis.
    """

    def __init__(self, harness: Harness, velocity: FloatArray, acceleration: FloatArray) -> None:
        self._harness, self._simulation = harness, harness.simulation
        self._highest, self._hardest = velocity, acceleration
        self._axes = len(velocity)
        self._period_s = harness.robot.control_loop.period_ns / 1e9
        self.may_enable = self.is_stopped = False
        self.excused = np.zeros(self._axes, int)  # periods in which an axis is not judged
        self.seen: list[str] = []
        self._engine: object = None
        self._time_ns = harness.clock.now_ns()
        self._was_on = np.zeros(self._axes, bool)
        self._position = self._command
        self._velocity: FloatArray | None = None  # of the period before; None: after a gap

    def excuse(self, seconds: float) -> None:
        self.excused = np.maximum(self.excused, round(seconds / self._period_s))

    def look(self, image: ProcessImage | None = None) -> None:
        simulation, now_ns = self._simulation, self._harness.clock.now_ns()
        on = np.array(simulation.states.servo_on[: self._axes], bool)
        elapsed_s = (now_ns - self._time_ns) / 1e9
        if simulation.engine is not self._engine:
            self._engine = simulation.engine
            self.excuse(RENUMBERED * self._period_s)
        coasting = round(COASTING_S / self._period_s)
        self.excused = np.where(on, self.excused, np.maximum(self.excused, coasting))
        if not self.may_enable:
            self.seen += [
                f"axis {axis} is switched on" for axis in np.flatnonzero(on > self._was_on)
            ]
        velocity = self._measure(elapsed_s)
        if velocity is not None and elapsed_s > 0.0:
            before = velocity if self._velocity is None else self._velocity
            for axis in np.flatnonzero(self.excused == 0).tolist():
                self._judge(axis, velocity[axis], (velocity - before)[axis] / elapsed_s)
        self._velocity = velocity
        self.excused = np.maximum(self.excused - 1, 0)
        self._was_on, self._position, self._time_ns = on, self._command, now_ns

    def _measure(self, elapsed_s: float) -> FloatArray | None:
        """Return the mean velocities in the last period; None: over a gap."""
        if not 0.0 < elapsed_s < 1.5 * self._period_s:
            return None
        change: FloatArray = self._command - self._position
        return change / elapsed_s

    def _judge(self, axis: int, velocity: float, acceleration: float) -> None:
        if self.is_stopped and abs(velocity) > STOPPED_RAD_S:
            self.seen.append(f"axis {axis} moves with {velocity:.2f} rad/s after a stop")
        if abs(velocity) > self._highest[axis]:
            self.seen.append(f"axis {axis} moves with {velocity:.2f} rad/s")
        if abs(acceleration) > self._hardest[axis]:
            self.seen.append(f"axis {axis} changes its speed by {acceleration:.0f} rad/s²")

    @property
    def _command(self) -> FloatArray:
        return np.array(self._simulation.servo.command[: self._axes], float)


class Play(ABC):
    """A robot, its witness, and the commands of an operator."""

    def __init__(self, harness: Harness, witness: Witness) -> None:
        self.harness, self.robot, self.witness = harness, harness.robot, witness
        self._axes = range(len(self.robot.axes))
        self._later: list[tuple[int, Callable[[], None]]] = []
        rate_hz = self.robot.descriptor.cycle.rate_hz
        self.robot.control_loop.every(rate_hz, "play", self._run_due, first=True)
        self.robot.control_loop.every(rate_hz, "witness", self.witness.look)

    def run(self, random: Random, commands: Commands, count: int) -> None:
        """Run ``count`` commands, then ``end``; nothing may be seen."""
        weights = [weight for weight, _ in commands.values()]
        try:
            self.requested(self.robot.start)
            for name in random.choices(tuple(commands), weights, k=count):
                arguments = [draw(random) for draw in commands[name][1]]
                with suppress(RobotdError):
                    getattr(self, f"_{name}")(*arguments)
                assert not self.witness.seen, (name, arguments)
            self.end()
        finally:
            self.robot.shutdown()
        self.witness.look()
        assert not self.witness.seen
        assert not self.harness.simulation.states.servo_on.any()

    @abstractmethod
    def end(self) -> None:
        """Mend everything, and reach a goal."""

    def mend(self) -> None:
        """Do all that an operator can, until the robot is at rest and takes commands."""
        faults = self.harness.faults
        self._later.clear()
        faults.freeze(False)
        for axis in self._axes:
            faults.reconnect(axis)
        with suppress(RobotdError):
            self.robot.fieldbus.start_hot_connect(0)
        self.release()
        self.robot.resume()
        self.robot.set_speed(1.0)
        self.harness.run(1.0)
        self.witness.is_stopped = False
        self.robot.reset()
        self.requested(self.robot.recover)
        self.robot.axes.stop_and_wait(self._axes, 20.0)
        self.set_modes()

    @abstractmethod
    def release(self) -> None:
        """End what clients hold."""

    @abstractmethod
    def set_modes(self) -> None:
        """Set the command modes as at start."""

    def requested(self, action: Callable[[], object]) -> None:
        """Run what may switch servos on."""
        self.witness.may_enable = True
        try:
            action()
        finally:
            self.witness.may_enable = False

    def later(self, seconds: float, action: Callable[[], None]) -> None:
        """Run ``action`` in the control loop."""
        self._later.append((self.harness.clock.now_ns() + round(seconds * 1e9), action))

    def _run_due(self, image: ProcessImage) -> None:
        now_ns = self.harness.clock.now_ns()
        due = [event for event in self._later if event[0] <= now_ns]
        self._later = [event for event in self._later if event[0] > now_ns]
        for _, action in due:
            with suppress(RobotdError):
                action()

    def _step(self, periods: int) -> None:
        self.robot.step(periods)

    def _mode(self, axis: int, mode: int) -> None:
        self.robot.axes.set_command_mode(axis, mode)

    def _servo(self, axis: int, on: bool) -> None:
        if on:
            self.requested(lambda: self.robot.axes.servo(axis, True))
        else:
            self.robot.axes.servo(axis, False)

    def _clear_alarm(self, axis: int) -> None:
        self.robot.axes.clear_alarm(axis)

    def _stop_axes(self, axes: Sequence[int], quick: bool) -> None:
        if quick:
            self.witness.excuse(STOPPING_S)  # by the deceleration of the device's parameters
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
        for action in (self._resume, self._reset, self._recover, self.set_modes):
            with suppress(RobotdError):
                action()

    def _disable(self) -> None:
        self.robot.servos.disable()

    def _stall(self, seconds: float) -> None:
        self.harness.stall(seconds)
        if seconds > 0.2:
            self.witness.excuse(STOPPING_S)  # the device has stopped by itself

    def _fault_later(self, name: str, axis: int, seconds: float) -> None:
        self.later(seconds, lambda: self._fault(name, axis))

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
