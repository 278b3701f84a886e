"""A device of fakes: an engine that is ready on request, three axes, I/O and a fieldbus."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import pytest

from robotd.clock import FakeClock
from robotd.descriptor import EngineSettings
from robotd.device.axes import Axes
from robotd.device.capabilities import Capability
from robotd.device.engine import Engine
from robotd.device.fieldbus import Fieldbus
from robotd.device.image import ProcessImage
from robotd.device.io import Io
from robotd.motion.limits import AxisLimits
from robotd.testing.fakes import FakeAxes, FakeDevice, FakeFieldbus, FakeIo

ALL = frozenset(Capability)
LIMITS = (AxisLimits(-1.0, 2.0, 3.0, 10.0), AxisLimits(-1.0, 2.0, 3.0, 10.0), AxisLimits.unlimited())
NAMES = ("joint1", "joint2", "axis 2")


@dataclass
class Bench:
    """Fakes below, the core's classes above. ``refresh`` does what the cycle does."""

    capabilities: frozenset[Capability] = ALL
    device: FakeDevice = field(default_factory=FakeDevice)
    driver: FakeAxes = field(default_factory=lambda: FakeAxes(3))
    io_driver: FakeIo = field(default_factory=FakeIo)
    fieldbus_driver: FakeFieldbus = field(default_factory=FakeFieldbus)
    clock: FakeClock = field(default_factory=FakeClock)

    def __post_init__(self) -> None:
        settings = EngineSettings(open_tries=3, open_retry_s=0.0)
        self.engine = Engine(self.device, settings, None, "fake")
        self.image = ProcessImage(3)
        self.axes = Axes(
            self.driver,
            self.image,
            self.engine,
            LIMITS,
            NAMES,
            self.capabilities,
            "fake",
            self.clock,
        )
        self.io = Io(self.io_driver, self.engine, "fake")
        self.fieldbus = Fieldbus(self.fieldbus_driver, self.engine, self.capabilities, "fake")

    def refresh(self) -> None:
        self.driver.read(self.image)

    def make_ready(self) -> Bench:
        """Communicating, servos on, at rest; earlier calls forgotten."""
        self.engine.start()
        self.driver.image.servo_on[:] = True
        self.refresh()
        self.device.calls.clear()
        return self


@pytest.fixture
def bench() -> Bench:
    return Bench().make_ready()


@pytest.fixture
def make_bench() -> Callable[..., Bench]:
    return Bench
