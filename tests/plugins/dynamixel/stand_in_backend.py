"""The backend dynamixel on the simulated bus of its test equipment, for the conformance kit."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

from tests.plugins.serial_servo.dxl_bus import DxlBus
from tests.plugins.serial_servo.dxl_servo import Servo
from tests.plugins.serial_servo.simulated_servo import SimulatedServo
from tests.plugins.serial_servo.stand_in import StandInDevice, StandInFaults, StandInOptions

import robotd_dynamixel
from robotd.api import (
    BackendInfo,
    Capability,
    DeviceContext,
    DeviceDriver,
    FaultInjector,
    hookimpl,
)
from robotd_dynamixel import dynamixel_bus, robotd_axes, robotd_fieldbus
from robotd_serial_servo.options import PlannedServo, ServoPlan

__all__ = ["robotd_axes", "robotd_fieldbus"]


class DynamixelStandInOptions(StandInOptions):
    """Servos of ``backends.dynamixel``."""

    section: ClassVar[str] = "backends.dynamixel_stand_in"
    family: ClassVar[str] = "dynamixel"

    exchange_period_s: float = 0.0125  # as DynamixelOptions


def make_servo(planned: PlannedServo, angle: float) -> Servo:
    """Return a servo without return delay, which boots at once."""
    servo = Servo(planned.model or "xl430-w250", angle=angle)
    servo.set("return_delay", 0)
    return servo


def trip(servo: SimulatedServo, bits: int) -> None:
    assert isinstance(servo, Servo)
    servo.trip(bits)


def shift(servo: SimulatedServo, ticks: int) -> None:
    servo.set("homing_offset", servo.get("homing_offset") + ticks)  # reported = true + offset


@hookimpl
def robotd_backend() -> BackendInfo:
    info: BackendInfo = robotd_dynamixel.robotd_backend()
    return replace(
        info,
        summary="dynamixel on simulated servos, for tests",
        capabilities=info.capabilities | {Capability.SIMULATED},
        options=DynamixelStandInOptions,
    )


@hookimpl
def robotd_open_device(context: DeviceContext[ServoPlan]) -> DeviceDriver:
    own_bus = dynamixel_bus.DynamixelBus
    return StandInDevice(context.robot, context.options, context.clock, own_bus, DxlBus, make_servo)


@hookimpl
def robotd_fault_injector(device: StandInDevice) -> FaultInjector:
    return StandInFaults(device, trip, shift)
