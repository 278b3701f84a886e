"""Error codes of CiA 301 and CiA 402: texts, classes, and remedies."""

from __future__ import annotations

from robotd.api import CodeTable

_FIRST_CODE = 0x1000
_VENDOR_CODES = 0xFF00  # from here on a code means what the vendor says
# CiA 301 table 27 and CiA 402-2 (error codes of 0x603F). The longest match wins.
_CLASSES = {
    0x00: "error reset or no error",  # 0x0000 to 0x00FF; 0x01 to 0x0F are not assigned
    0x10: "generic error",
    0x20: "current",
    0x21: "current, device input side",
    0x22: "current inside the device",
    0x23: "current, device output side",
    0x30: "voltage",
    0x31: "mains voltage",
    0x32: "voltage inside the device",
    0x33: "output voltage",
    0x40: "temperature",
    0x41: "ambient temperature",
    0x42: "device temperature",
    0x43: "drive temperature",
    0x50: "device hardware",
    0x60: "device software",
    0x61: "internal software",
    0x62: "user software",
    0x63: "data set",
    0x70: "additional modules",
    0x71: "power module",
    0x73: "sensor",
    0x80: "monitoring",
    0x81: "communication",
    0x82: "protocol error",
    0x83: "torque control",
    0x84: "velocity control",
    0x86: "position control",
    0x90: "external error",
    0xF0: "additional functions",
    0xFF: "device specific",
}
_CODES = {
    0x0000: "no error",
    0x2310: "continuous over-current",
    0x2320: "short circuit or earth leakage",
    0x2330: "earth leakage",
    0x2340: "short circuit",
    0x3110: "mains over-voltage",
    0x3120: "mains under-voltage",
    0x3210: "DC link over-voltage",
    0x3220: "DC link under-voltage",
    0x4210: "excess device temperature",
    0x4310: "excess drive temperature",
    0x5441: "quick stop input",
    0x6320: "parameter error",
    0x7121: "motor blocked",
    0x7305: "incremental sensor 1",
    0x7320: "position sensor",
    0x8110: "CAN overrun",
    0x8120: "CAN in error passive mode",
    0x8130: "life guard or heartbeat error",
    0x8140: "recovered from bus off",
    0x8150: "CAN-ID collision",
    0x8210: "PDO not processed due to length error",
    0x8220: "PDO length exceeded",
    0x8240: "unexpected SYNC data length",
    0x8250: "RPDO time-out",
    0x8311: "excess torque",
    0x8400: "velocity speed controller",
    0x8480: "velocity limit reached",
    0x8611: "following error",
    0x8612: "reference limit",
}


_REGISTER = {
    0x01: "generic",
    0x02: "current",
    0x04: "voltage",
    0x08: "temperature",
    0x10: "communication",
    0x20: "device profile",
    0x80: "manufacturer",
}


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


def error_text(code: int) -> str:
    """``0x3210 DC link over-voltage``; of the vendor's range only the number is known."""
    if code >= _VENDOR_CODES:
        return f"0x{code:04X} vendor specific"
    return f"0x{code:04X} {_CODES.get(code) or class_text(code) or 'reserved'}"


def class_text(code: int) -> str:
    """Return the class of a code of 16 bits, ``position control``; "" for none."""
    if not 0 <= code <= 0xFFFF:
        return ""
    if code >= _VENDOR_CODES:
        return "vendor specific"
    family = code >> 8 & 0xF0
    return _CLASSES.get(code >> 8) or (_CLASSES.get(family, "") if family else "")


def register_text(register: int) -> str:
    """``0x21 (generic, device profile)``: error register, object 0x1001."""
    named = ", ".join(name for bit, name in _REGISTER.items() if register & bit)
    return f"0x{register:02X} ({named or 'no error'})"


def drive_remedy(code: int) -> str:
    """Return what to do about an error code; "" where it is not known.

    Args:
        code: of CiA 402, 16 bit; the longest match counts.
    """
    if not _FIRST_CODE <= code < _VENDOR_CODES:
        return ""
    found = (_REMEDIES.get(part) for part in (code, code >> 8, code >> 12))
    return next(filter(None, found), "")


EMERGENCIES = CodeTable(
    "CANopen emergency, CiA 402 error code", dict(_CODES), other=class_text, remedy=drive_remedy
)
