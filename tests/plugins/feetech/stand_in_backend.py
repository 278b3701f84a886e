"""The backend feetech on the simulated bus of its test equipment, for the conformance kit."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

from tests.plugins.serial_servo.simulated_servo import SimulatedServo
from tests.plugins.serial_servo.stand_in import StandInDevice, StandInFaults, StandInOptions
from tests.plugins.serial_servo.sts_bus import StsBus
from tests.plugins.serial_servo.sts_servo import Servo

import robotd_feetech
from robotd.api import (
    BackendInfo,
    Capability,
    DeviceContext,
    DeviceDriver,
    FaultInjector,
    hookimpl,
)
from robotd_feetech import robotd_axes, robotd_fieldbus
from robotd_feetech import sts_bus as own_bus
from robotd_serial_servo.options import PlannedServo, ServoPlan

__all__ = ["robotd_axes", "robotd_fieldbus"]

# They leave a rest error of a tick more than the kit allows.
DEAD_ZONES = ("dead_zone_cw", "dead_zone_ccw")


class FeetechStandInOptions(StandInOptions):
    """Servos of ``backends.feetech``."""

    section: ClassVar[str] = "backends.feetech_stand_in"
    family: ClassVar[str] = "feetech"


class TrippedServo(Servo):
    """A servo that reports any status bits until its torque is switched off."""

    tripped = 0

    def _refresh(self) -> None:
        super()._refresh()
        self.set("status", self.get("status") | self.tripped)

    def write(self, address: int, data: bytes) -> None:
        if address == 40 and data[:1] == b"\x00":
            self.tripped = 0
        super().write(address, data)


def make_servo(planned: PlannedServo, angle: float) -> TrippedServo:
    """Return a servo without dead time, return delay and dead zones."""
    servo = TrippedServo(planned.model or "sts3215", angle=angle)
    servo.knobs.dead_time_s = 0.0
    servo.set("return_delay", 0)
    for name in DEAD_ZONES:
        servo.set(name, 0)
    return servo


def trip(servo: SimulatedServo, bits: int) -> None:
    assert isinstance(servo, TrippedServo)
    servo.tripped = bits


def shift(servo: SimulatedServo, ticks: int) -> None:
    servo.set("offset", servo.get("offset") - ticks)  # reported = true - offset


@hookimpl
def robotd_backend() -> BackendInfo:
    info: BackendInfo = robotd_feetech.robotd_backend()
    return replace(
        info,
        summary="feetech on simulated servos, for tests",
        capabilities=info.capabilities | {Capability.SIMULATED},
        options=FeetechStandInOptions,
    )


@hookimpl
def robotd_open_device(context: DeviceContext[ServoPlan]) -> DeviceDriver:
    return StandInDevice(
        context.robot, context.options, context.clock, own_bus.StsBus, StsBus, make_servo
    )


@hookimpl
def robotd_fault_injector(device: StandInDevice) -> FaultInjector:
    return StandInFaults(device, trip, shift)
