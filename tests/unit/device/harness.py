"""The core's device classes over fakes: engine, three axes, I/O and fieldbus."""

from __future__ import annotations

from dataclasses import dataclass, field

from tests.fakes import FakeAxes, FakeClock, FakeDevice, FakeFieldbus, FakeIo

from robotd.descriptor import EngineSettings
from robotd.device.axes import Axes
from robotd.device.capabilities import Capability
from robotd.device.connection import Connection
from robotd.device.fieldbus import Fieldbus
from robotd.device.io import Io
from robotd.device.process_image import ProcessImage
from robotd.motion.limits import AxisLimits

ALL = frozenset(Capability) - {Capability.TRAJECTORIES_ON_DEVICE}
JOINT = AxisLimits(-1.0, 2.0, 3.0, 10.0)
LIMITS = (JOINT, JOINT, AxisLimits.unlimited())
NAMES = ("joint1", "joint2", "axis 2")


@dataclass
class Harness:
    """Fakes below, the core's classes above. ``refresh`` does what the cycle does."""

    capabilities: frozenset[Capability] = ALL
    device: FakeDevice = field(default_factory=FakeDevice)
    driver: FakeAxes = field(default_factory=lambda: FakeAxes(3))
    io_driver: FakeIo = field(default_factory=FakeIo)
    fieldbus_driver: FakeFieldbus = field(default_factory=FakeFieldbus)
    clock: FakeClock = field(default_factory=FakeClock)

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
        )
        self.io = Io(self.io_driver, self.connection, "fake")
        self.fieldbus = Fieldbus(self.fieldbus_driver, self.connection, self.capabilities, "fake")

    def refresh(self) -> None:
        self.driver.read(self.image)

    def make_ready(self) -> Harness:
        """Communicating, servos on, at rest; earlier calls forgotten."""
        self.connection.start()
        self.driver.image.servo_on[:] = True
        self.refresh()
        self.device.calls.clear()
        return self
