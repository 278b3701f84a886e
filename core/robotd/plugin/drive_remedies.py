"""Remedies for the error codes of drives after CiA 402, by code or by class."""

from __future__ import annotations

FIRST_CODE = 0x1000
VENDOR_CODES = 0xFF00  # from here on a code means what the vendor says

_REMEDIES = {
    0x2: "Look for a blocked axis, too much load, or a fault of the motor or its cable",
    0x23: "Look for a blocked axis, too much load, or a short circuit in the motor or its cable",
    0x2320: "Switch the power off; check motor and motor cable for a short circuit or earth fault",
    0x2330: "Switch the power off; check motor and motor cable for an earth fault",
    0x2340: "Switch the power off; check motor and motor cable for a short circuit",
    0x3: "Check the supply voltage of the drive",
    0x3110: "Check the mains voltage",
    0x3120: "Check the mains voltage and its fuses",
    0x3210: "Check braking resistor and supply; decelerate more gently",
    0x3220: "Check the power supply, its fuses, and the emergency stop circuit",
    0x4: "Let it cool down; check the ventilation, and lower load or accelerations",
    0x5: "Switch the drive off and on; if the fault stays, replace the drive",
    0x5441: "Release the quick stop input",
    0x6: "Check the parameters and the firmware of the drive",
    0x70: "Check the additional module and its connector",
    0x71: "Look for a blocked axis or a brake that does not open; check the motor",
    0x73: "Check the encoder, its cable and its connectors",
    0x80: "Check the monitoring functions in the parameters of the drive",
    0x81: "Check cable and termination of the fieldbus, and that each node has its own id",
    0x82: "Check that the PDO mapping of drive and descriptor agree",
    0x83: "Look for a blocked axis or too much load; check the torque limit",
    0x84: "Look for too much load; check the velocity limit and the tuning of the drive",
    0x86: "Look for a blocked axis or too much load; check the tuning and the drive's error window",
    0x90: "Remove the external fault that the drive reports",
}
"""By code, by its first two hexadecimal digits, and by the first one."""


def drive_remedy(code: int) -> str:
    """Return what to do about an error code; "" where it is not known.

    Args:
        code: of CiA 402, 16 bit; the longest match counts.
    """
    if not FIRST_CODE <= code < VENDOR_CODES:
        return ""
    found = (_REMEDIES.get(part) for part in (code, code >> 8, code >> 12))
    return next(filter(None, found), "")
