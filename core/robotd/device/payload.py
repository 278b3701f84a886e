"""Payload of an arm: the mass that its drives carry besides its own links."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

from robotd.device.axes import Axes
from robotd.errors import InvalidArgument, Unsupported
from robotd.events import logged_command

MAX_CENTER_M = 2.0  # farther from the flange no arm of this size carries anything
FEATURE = "a payload"


@dataclass(frozen=True)
class Payload:
    """Load on the flange: gripper, tool and part together.

    Attributes:
        mass_kg: 0 or more.
        center_m: x, y and z of its centre of mass in the frame of the flange, m.
    """

    mass_kg: float
    center_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __str__(self) -> str:
        """Return ``0.8 kg at x 0, y 0, z 0.06 m of the flange``."""
        x, y, z = self.center_m
        return f"{self.mass_kg:g} kg at x {x:g}, y {y:g}, z {z:g} m of the flange"


class PayloadDriver(ABC):
    """Compensation of what the flange carries, by the device. Worker threads only."""

    @property
    @abstractmethod
    def max_kg(self) -> float:
        """Largest mass that the device takes, kg; inf: it rejects what is too much by itself."""

    @abstractmethod
    def payload(self) -> Payload | None:
        """Return what the device compensates; None: it does not tell. In any state; never blocks.

        Without the weight of what the device regards as part of the arm.
        """

    @abstractmethod
    def set_payload(self, payload: Payload, timeout_s: float) -> None:
        """Compensate ``payload`` instead of the one before; wait until the device does.

        Called while the device communicates and all joints are idle; no motion begins meanwhile.
        Nothing moves, and servos are as they were before. It holds, also with servos off, until
        another one is set or the device is closed. On an error the one before holds.
        """


class PayloadSetting:
    """The payload of a robot's arm. Worker threads only.

    Args:
        driver: of the backend; None: it has none.
        axes, joint_axes: of the robot, and those that have to be at rest.

    Attributes:
        max_kg: largest mass that the device takes; inf: not known.
    """

    def __init__(self, driver: PayloadDriver | None, axes: Axes, joint_axes: Sequence[int]) -> None:
        self.events = axes.events
        self.max_kg = math.inf if driver is None else driver.max_kg
        self._driver, self._axes, self._joint_axes = driver, axes, joint_axes

    def current(self) -> Payload | None:
        """Return the payload in force; None: the device does not tell. Raises Unsupported."""
        return self._require().payload()

    def check(self, payload: Payload) -> None:
        """Raise Unsupported: no payload can be set; InvalidArgument: not this one."""
        self._require()
        mass_kg = payload.mass_kg
        if not 0.0 <= mass_kg <= self.max_kg or math.isinf(mass_kg):
            most = "finite" if math.isinf(self.max_kg) else f"{self.max_kg:g} kg at most"
            raise InvalidArgument(f"payload: {mass_kg:g} kg, must be 0 or more and {most}")
        for name, value in zip("xyz", payload.center_m, strict=True):
            if not abs(value) <= MAX_CENTER_M:
                limit = f"at most {MAX_CENTER_M:g} m from the flange"
                raise InvalidArgument(f"payload: {name} of its centre is {value:g} m, {limit}")

    @logged_command
    def set_payload(self, payload: Payload) -> None:
        """Let the device compensate ``payload`` from now on; returns when it does. Nothing moves.

        Raises Unsupported, InvalidArgument: see ``check``; NotReady: a joint moves, is guided by
        hand or has an owner; OperationError, DeviceTimeout: the device has not taken it.
        """
        self._axes.stop_latch.check_commandable()
        self.check(payload)
        timeout_s = self._axes.connection.settings.servo_timeout_s
        with self._axes.kept_at_rest("setting the payload", self._joint_axes):
            self._require().set_payload(payload, timeout_s)

    def _require(self) -> PayloadDriver:
        if self._driver is None:
            raise Unsupported(FEATURE, self._axes.backend)
        return self._driver
