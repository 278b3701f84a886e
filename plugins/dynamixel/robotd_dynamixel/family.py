"""The family of Dynamixel servos, for commands of ``robotd_serial_servo``."""

from __future__ import annotations

from robotd_dynamixel.dynamixel_bus import DynamixelBus
from robotd_dynamixel.options import DynamixelOptions
from robotd_serial_servo.families import Family

DYNAMIXEL = Family(DynamixelOptions, DynamixelBus)
