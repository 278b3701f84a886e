"""Format of the messages: commands and replies as text, feedback as a structure of 1440 bytes.

Angles are in degrees. Facts from the vendor's public description of its TCP/IP protocol.
"""

from __future__ import annotations

import re

import numpy as np

from robotd.api import FloatArray, OperationError

FEEDBACK_PERIOD_S = 0.008
TEST_VALUE = 0x0123456789ABCDEF  # in each packet: both sides count the bytes alike

FEEDBACK = np.dtype(
    {
        "names": ["size", "inputs", "outputs", "test_value", "position", "velocity", "enabled",
                  "error"],
        "formats": ["<u2", "<u8", "<u8", "<u8", ("<f8", 6), ("<f8", 6), "u1", "u1"],
        "offsets": [0, 8, 16, 48, 432, 480, 1026, 1029],
        "itemsize": 1440,
    }
)  # fmt: skip
"""The fields that are used; the packet has about eighty."""

MODES = {
    1: "initializing", 2: "brakes open", 4: "disabled", 5: "enabled", 6: "dragged", 7: "running",
    8: "recording", 9: "in alarm", 10: "paused", 11: "jogging",
}  # fmt: skip
REASONS = {
    -1: "execution failed",
    -2: "the controller is in alarm",
    -3: "the emergency stop is pressed",
    -10000: "unknown command",
}
_REPLY = re.compile(r"(-?\d+),\{(.*)\},(\w+)\(.*\);", re.DOTALL)


def command(name: str, *values: float) -> str:
    """Return a command: ``command("DO", 1, 0)`` is ``DO(1,0)``."""
    return f"{name}({','.join(f'{value:g}' for value in values)})"


def servo_target(position_deg: FloatArray, time_s: float) -> bytes:
    """Return the target of all joints, to be reached after ``time_s``."""
    angles = ",".join(f"{angle:.6f}" for angle in position_deg.tolist())
    return f"ServoJ({angles},t={time_s:.4f})".encode("ascii")


def parse_reply(text: str, name: str) -> str:
    """Return the value of a reply to the command ``name``: ``0,{5},RobotMode();`` has ``5``.

    Raises OperationError: the controller rejected the command, or answered another one.
    """
    found = _REPLY.fullmatch(text.strip())
    if not found or found[3].lower() != name.lower():
        raise OperationError(f"{name}: the controller answered {text[:80]!r}")
    code = int(found[1])
    if code:
        raise OperationError(f"{name}: {REASONS.get(code, f'error {code}')}", code=code)
    return found[2]


def first_alarm(value: str) -> int:
    """Return the first number in the value of ``GetErrorID``, ``[[17],[],…]``; 0: no alarm."""
    found = re.search(r"-?\d+", value)
    return int(found[0]) if found else 0
