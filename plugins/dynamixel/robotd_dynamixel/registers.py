"""Registers of Dynamixel X servos, after the maker's control tables, and their hardware errors."""

from __future__ import annotations

from collections.abc import Iterator

MODEL, FIRMWARE, REPLY_DELAY, DRIVE_MODE, MODE, OFFSET = 0, 6, 9, 10, 11, 20
PWM_LIMIT, MAX_POSITION, MIN_POSITION = 36, 48, 52
SETTINGS_BYTES = 64  # from 0 on: what survives power-off
TORQUE, HARDWARE_ERROR, WATCHDOG, GOAL_PWM = 64, 70, 98, 100
PROFILE, GOAL, POSITION = 108, 116, 132  # PROFILE: acceleration, velocity, 4 bytes each
STATE, STATE_BYTES = TORQUE, 83  # 64 to 146: commands as the servo has them, and measurements

REPLY_DELAY_S = 2e-6  # each
FULL_PWM = 885
LEAST_PWM_LIMIT = 250  # below it a part of it is not resolved
TICKS_S = 4096 * 0.229 / 60.0  # each unit of velocity
WATCHDOG_S = 0.02  # each
EXPIRED = -1  # of WATCHDOG
TIMED_PROFILE, GOAL_SWITCHES_ON = 0x04, 0x08  # of DRIVE_MODE: profiles are in ms; torque by a goal
POSITION_MODE, EXTENDED_MODE = 3, 4
POSITION_MODES = {POSITION_MODE, EXTENDED_MODE, 5}
MODES = {0: "current", 1: "velocity", 16: "PWM"}
MAX_OFFSET = 1024  # in position mode; greater offsets have no effect
WATCHDOG_FIRMWARE = 38

MODELS = {
    1020: "xm430-w350",
    1030: "xm430-w210",
    1060: "xl430-w250",
    1070: "xc430-w150",
    1080: "xc430-w240",
    1090: "2xl430-w250",
    1120: "xm540-w270",
    1130: "xm540-w150",
    1190: "xl330-m077",
    1200: "xl330-m288",
    1240: "xc330-m288",
}
AMPERES = {"xm430": 0.00269, "xm540": 0.00269, "xl330": 0.001, "xc330": 0.001}  # others: none

FAULTS = {
    0x01: "supply voltage out of range",
    0x02: "motor position sensor",
    0x04: "too hot",
    0x08: "encoder",
    0x10: "electrical shock, or too little power",
    0x20: "overload",
}
_REBOOT = "clearing the alarm restarts the servo without torque, so support the arm"
REMEDIES = {
    0x01: "Measure the supply at the servo under load: 12 V for XL430 and XM430, 5 V for XL330;"
    f" {_REBOOT}",
    0x02: f"Replace the servo if the fault comes back; {_REBOOT}",
    0x04: f"Let it cool down, and relieve the joint; {_REBOOT}",
    0x08: f"Replace the servo if the fault comes back; {_REBOOT}",
    0x10: f"Check the supply and its cable for a short circuit; {_REBOOT}",
    0x20: f"Remove the load or the obstacle; {_REBOOT}",
}


def fault_text(code: int) -> str:
    """Return the hardware errors of register 70 in words, joined by commas."""
    return ", ".join(FAULTS[bit] for bit in _bits(code))


def fault_remedy(code: int) -> str:
    """Return what to do about register 70."""
    return ". ".join(REMEDIES[bit] for bit in _bits(code))


def _bits(code: int) -> Iterator[int]:
    return (bit for bit in FAULTS if code & bit)
