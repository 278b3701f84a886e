"""Error codes of CiA 301 and CiA 402: texts, classes, and remedies."""

from __future__ import annotations

from robotd.api import CodeTable, drive_remedy

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


def error_text(code: int) -> str:
    """``0x3210 DC link over-voltage``; of the vendor's range only the number is known."""
    if code >= 0xFF00:
        return f"0x{code:04X} vendor specific"
    return f"0x{code:04X} {_CODES.get(code) or class_text(code) or 'reserved'}"


def class_text(code: int) -> str:
    """Return the class of a code of 16 bits, ``position control``; "" for none."""
    if not 0 <= code <= 0xFFFF:
        return ""
    if code >= 0xFF00:
        return "vendor specific"
    family = code >> 8 & 0xF0
    return _CLASSES.get(code >> 8) or (_CLASSES.get(family, "") if family else "")


def register_text(register: int) -> str:
    """``0x21 (generic, device profile)``: error register, object 0x1001."""
    named = ", ".join(name for bit, name in _REGISTER.items() if register & bit)
    return f"0x{register:02X} ({named or 'no error'})"


EMERGENCIES = CodeTable(
    "CANopen emergency, CiA 402 error code", dict(_CODES), other=class_text, remedy=drive_remedy
)
