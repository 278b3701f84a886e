"""Keys of ``backends.feetech`` in a robot's file."""

from __future__ import annotations

from typing import ClassVar

from robotd_serial_servo.options import SerialServoOptions


class FeetechOptions(SerialServoOptions):
    """Port, calibration and servos of a bus with STS or SMS servos."""

    section: ClassVar[str] = "backends.feetech"
