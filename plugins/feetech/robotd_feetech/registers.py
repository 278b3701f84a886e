"""Registers of STS and SMS servos, after the makers' memory table 3.7, and their fault bits."""

from __future__ import annotations

from collections.abc import Iterator

FIRMWARE, MODEL, REPLY_DELAY, REPLY_LEVEL = 0, 3, 7, 8
MIN_ANGLE, MAX_ANGLE, MAX_TORQUE, PHASE, OFFSET, MODE = 9, 11, 16, 18, 31, 33
SETTINGS_BYTES = 40  # from 0 on: what survives power-off
TORQUE, ACCELERATION, GOAL, GOAL_TIME, GOAL_SPEED = 40, 41, 42, 44, 46
TORQUE_LIMIT, LOCK, POSITION, SPEED, LOAD = 48, 55, 56, 58, 60
VOLTAGE, TEMPERATURE, STATUS, CURRENT = 62, 63, 65, 69
STATE, STATE_BYTES = TORQUE, 31  # 40 to 70: commands as the servo has them, and measurements

REPLY_DELAY_S = 2e-6  # each
FULL_TORQUE = 1000
FASTEST_RAMP = 254  # x 100 steps/s²
AMPERES = 0.0065  # each
SIGN, LOAD_SIGN, OFFSET_SIGN = 15, 10, 11  # bits
BEYOND_ONE_TURN = 0x10  # of PHASE
SPEED_IN_STEPS = 0x04  # of PHASE; without it speeds are in COARSE_SPEED
COARSE_SPEED = 50  # steps/s
MAX_OFFSET = 2047
MODES = {0: "position", 1: "velocity", 2: "PWM", 3: "step"}

MODELS = {
    777: "sts3215",
    2825: "sts3250",
    11272: "sm8512bl",
}

FAULTS = {
    0x01: "supply voltage out of range",
    0x02: "position sensor",
    0x04: "too hot",
    0x08: "current too high",
    0x10: "angle out of range",
    0x20: "overload",
}
REMEDIES = {
    0x01: "Measure the supply at the servo under load: 6 to 8.4 V for the 7.4 V part, 12 V for the"
    " 12 V part; six servos need 5 A",
    0x02: "Switch the servo off and on; replace it if the fault comes back",
    0x04: "Let it cool down, and relieve the joint: a servo heats up while it holds a load",
    0x08: "Free the joint and look for a short circuit in its cable",
    0x10: "Turn the joint back into its range by hand, with the servo off",
    0x20: "Support the joint: clearing the alarm switches the servo off, and the arm may fall. Then"
    " remove the load or the obstacle; if the alarm stays, switch the supply off and on",
}


def fault_text(code: int) -> str:
    """Return the faults of a status byte in words, joined by commas."""
    return ", ".join(FAULTS[bit] for bit in _bits(code))


def fault_remedy(code: int) -> str:
    """Return what to do about a status byte."""
    return ". ".join(REMEDIES[bit] for bit in _bits(code))


def _bits(code: int) -> Iterator[int]:
    return (bit for bit in FAULTS if code & bit)
