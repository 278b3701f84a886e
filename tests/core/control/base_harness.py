"""A mobile base on the simulation, on a clock that the test advances."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from tests.fakes import FakeClock

from robotd.clock import NANOSECONDS
from robotd.descriptor import RobotDescriptor
from robotd.motion.planar import PlanarTwist
from robotd.plugin.manager import load_backend
from robotd.robot import Robot
from robotd_sim.simulation import Simulation

COMMAND_S = 0.05  # between two commands of a client


class SteppingClock(FakeClock):
    """Clock that runs control periods in sleeps, except in those of the base's thread."""

    def __init__(self, period_s: float) -> None:
        super().__init__()
        self.step: Callable[[], None] = lambda: None
        self._period_ns, self.stepped_ns = round(period_s * NANOSECONDS), self.now_ns()

    def sleep_until_ns(self, deadline_ns: int) -> None:
        if threading.current_thread().name == "robotd-base":
            time.sleep(1e-4)
            return
        while self.stepped_ns + self._period_ns <= deadline_ns:
            self.step()
        super().sleep_until_ns(deadline_ns)


class BaseHarness:
    """A robot with a base, enabled, on a clock that the test advances."""

    def __init__(self, descriptor: RobotDescriptor) -> None:
        self.period_s = 1.0 / descriptor.cycle.rate_hz
        self.clock = SteppingClock(self.period_s)
        self.clock.step = self.step
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Simulation, "__init__", self._remember(Simulation.__init__))
            self.robot = Robot(descriptor, load_backend("sim"), self.clock)
        assert self.robot.base is not None
        self.base = self.robot.base
        self.base.start()
        self.up()

    def _remember(self, init: Callable[..., None]) -> Callable[..., None]:
        def remembering(simulation: Simulation, *arguments: Any) -> None:
            init(simulation, *arguments)
            self.simulation = simulation

        return remembering

    def up(self) -> None:
        self.robot.connection.start()
        self.step()
        self.robot.servos.enable()
        self.step()

    def step(self) -> None:
        self.clock.advance(self.period_s)
        self.clock.stepped_ns = self.clock.now_ns()
        self.robot.control_loop.step(self.clock.now_ns())

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / self.period_s)):
            self.step()

    def drive(self, linear: float, angular: float, seconds: float, lateral: float = 0.0) -> None:
        """Send commands for ``seconds``, then none."""
        for _ in range(round(seconds / COMMAND_S)):
            self.base.command(linear, angular, lateral)
            self.settle()
            self.run(COMMAND_S)

    def settle(self) -> None:
        """Wait until the base's thread has claimed or released the wheels."""
        base = self.base
        self.wait(lambda: base.moving or base._worker.settled)

    def wait(self, condition: Callable[[], bool]) -> None:
        """Wait for another thread; periods run meanwhile, as it may wait for the image."""
        deadline = time.monotonic() + 5.0
        while not condition():
            assert time.monotonic() < deadline
            time.sleep(1e-3)
            if not condition():
                self.clock.step()

    def close(self) -> None:
        closing = threading.Thread(target=self.base.close)
        closing.start()
        self.wait(lambda: not closing.is_alive())

    @property
    def twist(self) -> PlanarTwist:
        return self.base.twist(self.robot.image)

    def wheel(self, axis: int) -> float:
        """Return the true position of a wheel, ahead of encoder and process image."""
        return float(self.simulation.servo.position[axis])


def running(descriptor: RobotDescriptor) -> Iterator[BaseHarness]:
    made = BaseHarness(descriptor)
    yield made
    made.close()
