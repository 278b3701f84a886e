"""Texts of alarms and faults of the simulated drives and slaves."""

from __future__ import annotations

ALARMS = {
    0x2310: "continuous overcurrent",
    0x2320: "short circuit",
    0x3210: "DC link over-voltage",
    0x3220: "DC link under-voltage",
    0x4210: "device too hot",
    0x4310: "drive too hot",
    0x5210: "measurement circuit fault",
    0x7120: "motor fault",
    0x7121: "motor blocked",
    0x7305: "encoder fault",
    0x8130: "heartbeat lost",
    0x8611: "following error",
}
"""Error codes of CiA 402 and their meaning, as far as arms and bases need them."""

NO_ANSWER = "does not answer: cable or power supply"
NO_FRAMES = "no frame comes back from the fieldbus"


def alarm_text(code: int) -> str:
    """The meaning of an alarm; its number in hexadecimal where it has none here."""
    return ALARMS.get(code, f"error 0x{code:04X}")
