"""Alarms of the servos, for ``robotd explain``, the live page and the process image."""

from __future__ import annotations

from robotd.api import CodeTable
from robotd_dynamixel.registers import FAULTS, fault_remedy, fault_text
from robotd_serial_servo.servo_faults import REMEDIES, TEXTS, Fault


def _remedy(code: int) -> str:
    return REMEDIES[Fault(code)] if code in TEXTS else fault_remedy(code)


ALARMS = CodeTable(
    "alarm of a Dynamixel servo",
    FAULTS | {int(fault): text for fault, text in TEXTS.items()},
    digits=2,
    other=lambda code: fault_text(code) if 0 < code < 0x40 else "",
    remedy=_remedy,
)
