"""Keys of ``backends.dynamixel`` in a robot's file."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field

from robotd_serial_servo.options import SerialServoOptions


class DynamixelOptions(SerialServoOptions):
    """Port, calibration and servos of a bus with Dynamixel X servos."""

    section: ClassVar[str] = "backends.dynamixel"

    exchange_period_s: float = Field(
        0.0125,
        ge=0.002,
        le=0.05,
        description="Time between two exchanges with all servos. At 1 Mbit/s six of them take"
        " 6.5 ms on the wire.",
    )
    response_s: float = Field(
        0.05,
        ge=0.0,
        le=0.5,
        description="Time from a goal to the motion: following errors are judged by the goal of"
        " that much earlier.",
    )
