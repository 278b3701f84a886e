"""The core's device classes over fakes: engine, three axes, I/O and fieldbus."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from tests.fakes import FakeAxes, FakeClock, FakeDevice, FakeFieldbus, FakeIo

from robotd.descriptor import EngineSettings
from robotd.device.axes import Axes, Move
from robotd.device.capabilities import Capability
from robotd.device.connection import Connection
from robotd.device.fieldbus import Fieldbus
from robotd.device.io import Io
from robotd.device.process_image import ProcessImage
from robotd.errors import RobotdError
from robotd.motion.limits import AxisLimits
from robotd.motion.profile import Profile

ALL = frozenset(Capability) - {Capability.TRAJECTORIES_ON_DEVICE}
JOINT = AxisLimits(-1.0, 2.0, 3.0, 10.0)
LIMITS = (JOINT, JOINT, AxisLimits.unlimited())
NAMES = ("joint1", "joint2", "axis 2")
PROFILE = Profile(1.0, 5.0, 5.0)

Command = Callable[[Axes, int], Any]

ONE_AXIS: dict[str, Command] = {
    "servo": lambda axes, axis: axes.servo(axis, True),
    "clear_alarm": lambda axes, axis: axes.clear_alarm(axis),
    "set_command_mode": lambda axes, axis: axes.set_command_mode(axis, 1),
    "set_polarity": lambda axes, axis: axes.set_polarity(axis, -1),
    "set_gear_ratio": lambda axes, axis: axes.set_gear_ratio(axis, 1000.0, 2.0),
    "home": lambda axes, axis: axes.home(axis),
    "move": lambda axes, axis: axes.move([Move(axis, 0.5, PROFILE)]),
}


def rejected(
    harness: Harness, error: type[RobotdError], text: str, command: Callable[[], Any]
) -> None:
    before = list(harness.driver.calls)
    with pytest.raises(error, match=text):
        command()
    assert harness.driver.calls == before


def make_connection(
    device: FakeDevice, parameters: Path | None = None, **settings: Any
) -> Connection:
    return Connection(
        device, EngineSettings(**{"open_retry_s": 0.0, **settings}), parameters, "fake"
    )


def call_names(device: FakeDevice) -> list[object]:
    return [call[0] for call in device.calls]


class SleepClock(FakeClock):
    """Clock that calls ``on_sleep`` when a thread has slept on it."""

    on_sleep: Callable[[], object] | None = None

    def sleep_until_ns(self, deadline_ns: int) -> None:
        super().sleep_until_ns(deadline_ns)
        if self.on_sleep is not None:
            self.on_sleep()


@dataclass
class Harness:
    """Fakes below, the core's classes above. ``refresh`` does what the cycle does.

    Once it is ready, a thread that sleeps on the clock finds a new image, unless ``on_sleep`` of
    the clock is None: then no values come.
    """

    capabilities: frozenset[Capability] = ALL
    device: FakeDevice = field(default_factory=FakeDevice)
    driver: FakeAxes = field(default_factory=lambda: FakeAxes(3))
    io_driver: FakeIo = field(default_factory=FakeIo)
    fieldbus_driver: FakeFieldbus = field(default_factory=FakeFieldbus)
    clock: SleepClock = field(default_factory=SleepClock)

    def __post_init__(self) -> None:
        settings = EngineSettings(open_tries=3, open_retry_s=0.0)
        self.connection = Connection(self.device, settings, None, "fake")
        self.image = ProcessImage(3)
        self.axes = Axes(
            self.driver,
            self.image,
            self.connection,
            LIMITS,
            NAMES,
            self.capabilities,
            "fake",
            self.clock,
            0.002,
        )
        self.io = Io(self.io_driver, self.connection, "fake")
        self.fieldbus = Fieldbus(self.fieldbus_driver, self.connection, self.capabilities, "fake")

    def refresh(self) -> None:
        self.clock.advance(0.002)
        self.show()

    def show(self) -> None:
        """Read an image that is as new as the clock."""
        self.driver.read(self.image)
        self.image.stamp_ns = self.image.fresh_ns = self.clock.now_ns()
        self.axes.stops.look(self.image)

    def make_ready(self) -> Harness:
        """Communicating, servos on, at rest; earlier calls forgotten."""
        self.connection.start()
        self.driver.image.servo_on[:] = True
        self.refresh()
        self.device.calls.clear()
        self.clock.on_sleep = self.show
        return self
