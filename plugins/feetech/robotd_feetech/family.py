"""The family of Feetech servos, for commands of ``robotd_serial_servo``."""

from __future__ import annotations

from robotd_feetech.options import FeetechOptions
from robotd_feetech.sts_bus import StsBus
from robotd_serial_servo.families import Family

FEETECH = Family(FeetechOptions, StsBus)
