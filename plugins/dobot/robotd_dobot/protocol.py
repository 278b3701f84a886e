"""Format of the messages: commands and replies as text, feedback as a structure of 1440 bytes.

Angles are in degrees. From the maker's guides "TCP/IP Remote Control Interface" V3 and V4.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from robotd.api import FloatArray, NotReady, OperationError, Payload

JOINTS = 6
FEEDBACK_PERIOD_S = 0.008
TEST_VALUE = 0x0123456789ABCDEF  # in each packet: both sides count the bytes alike

FEEDBACK = np.dtype(
    {
        "names": ["size", "inputs", "outputs", "mode", "test_value", "position", "velocity",
                  "user_frame", "tool_frame", "enabled", "dragged", "error", "model", "load_kg",
                  "load_center_mm"],
        "formats": ["<u2", "<u8", "<u8", "<u8", "<u8", ("<f8", JOINTS), ("<f8", JOINTS),
                    "u1", "u1", "u1", "u1", "u1", "u1", "<f8", ("<f8", 3)],
        "offsets": [0, 8, 16, 24, 48, 432, 480, 1012, 1013, 1026, 1027, 1029, 1031, 1168, 1176],
        "itemsize": 1440,
    }
)  # fmt: skip
"""The fields that are used; the packet has about eighty."""

MODELS = {
    3: "CR3", 5: "CR5", 7: "CR7", 10: "CR10", 12: "CR12", 16: "CR16", 101: "Nova 2", 103: "Nova 5",
    113: "CR3A", 115: "CR5A", 117: "CR7A", 120: "CR10A", 122: "CR12A", 126: "CR16A", 130: "CR20A",
    150: "Magician E6",
}  # fmt: skip


class Mode(IntEnum):
    """Modes that mean the same to both generations; ``Dialect.modes`` names the others."""

    INITIALIZING = 1
    BRAKES_OPEN = 2
    POWER_OFF = 3
    DISABLED = 4
    ENABLED = 5
    DRAGGED = 6
    RUNNING = 7
    ALARM = 9
    PAUSED = 10


TAKES_TARGETS = (Mode.ENABLED, Mode.RUNNING)
MODES = {
    Mode.INITIALIZING: "the controller is starting",
    Mode.BRAKES_OPEN: "a brake is open",
    Mode.POWER_OFF: "the arm has no power",
    Mode.DISABLED: "disabled",
    Mode.ENABLED: "enabled",
    Mode.DRAGGED: "the arm is in drag mode",
    Mode.RUNNING: "running",
    Mode.ALARM: "in alarm",
    Mode.PAUSED: "a program on the controller is paused: stop it in the maker's software",
}


@dataclass(frozen=True)
class Dialect:
    """Differences between the generations of controllers.

    Attributes:
        modes: text of each mode that ``MODES`` lacks.
        set_output, set_tool_output: commands that switch an output at once.
        get_tool_output: command that asks for an output of the tool; "": there is none.
        has_motion_port: targets go to a port of their own, where nothing answers for certain.
        min_target_s: shortest time of a target.
        sets_payload: with a centre, also while the arm is on.
        max_frame: last index of the tool and of the user frames.
    """

    name: str
    modes: Mapping[int, str]
    set_output: str
    set_tool_output: str
    get_tool_output: str
    has_motion_port: bool
    min_target_s: float
    sets_payload: bool
    max_frame: int

    def mode_text(self, mode: int) -> str:
        """Return a mode in words."""
        return self.modes.get(mode) or f"mode {mode}"

    def servo_target(
        self,
        position_deg: FloatArray,
        time_s: float,
        lookahead: float | None = None,
        gain: float | None = None,
    ) -> str:
        """Return the target of all joints, to be reached after ``time_s``."""
        words = [f"{angle:.6f}" for angle in position_deg.tolist()]
        values = {"t": f"{time_s:.4f}"}
        if lookahead is not None or gain is not None:
            values["aheadtime"] = f"{DEFAULT_LOOKAHEAD if lookahead is None else lookahead:g}"
            values["gain"] = f"{DEFAULT_GAIN if gain is None else gain:g}"
        by_name = not self.has_motion_port
        words += [f"{key}={value}" if by_name else value for key, value in values.items()]
        return f"ServoJ({','.join(words)})"


DEFAULT_LOOKAHEAD, DEFAULT_GAIN = 50.0, 500.0
V3 = Dialect(
    "V3",
    MODES | {8: "the arm is recorded in drag mode", 11: "another client jogs the arm"},
    "DOExecute",
    "ToolDOExecute",
    get_tool_output="",
    has_motion_port=True,
    min_target_s=0.02,
    sets_payload=False,
    max_frame=9,
)
V4 = Dialect(
    "V4",
    MODES | {8: "another client moves the arm", 11: "the arm has hit something"},
    "DOInstant",
    "ToolDOInstant",
    get_tool_output="GetToolDO",
    has_motion_port=False,
    min_target_s=0.004,
    sets_payload=True,
    max_frame=50,
)
DIALECTS = {"v3": V3, "v4": V4}
GENERATION_QUERY = "GetCurrentCommandID"  # changes nothing; V3 does not know it

UNKNOWN_COMMAND = -10000
NOT_TCP = "Control Mode Is Not Tcp"
REASONS = {
    -1: "execution failed",
    -2: "the controller is in alarm",
    -3: "the emergency stop is pressed",
    -4: "the arm has no power",
    -5: "a program runs on the controller: stop it in the maker's software",
    -7: "a program on the controller is paused: stop it in the maker's software",
    -8: "the certificate of the controller has expired: ask the maker",
    UNKNOWN_COMMAND: "unknown command",
    -20000: "wrong number of parameters",
    -40001: "its first parameter is out of range",
}
# NOT_TCP comes without the semicolon that ends all others.
REPLY_END = re.compile(rb"[^;]*;|\s*" + NOT_TCP.encode("ascii") + rb"\s*")
_REPLY = re.compile(r"\s*(-?\d+),\{(.*)\},(\w+)\(.*\);\s*", re.DOTALL)


def command(name: str, *values: float) -> str:
    """Return a command: ``command("DO", 1, 0)`` is ``DO(1,0)``."""
    return f"{name}({','.join(f'{value:g}' for value in values)})"


def in_kg_and_mm(payload: Payload) -> tuple[float, ...]:
    """Return a payload as commands have it: mass, and its centre in mm."""
    return payload.mass_kg, *(1e3 * value for value in payload.center_m)


def parse_reply(text: str, name: str) -> str:
    """Return the value of a reply to the command ``name``: ``0,{5},RobotMode();`` has ``5``.

    Raises NotReady: the controller is not in TCP mode. OperationError: it rejected the command, or
    answered another one.
    """
    if text.strip() == NOT_TCP:
        raise NotReady(f"{name}: the controller is not in TCP mode")
    found = _REPLY.fullmatch(text)
    if not found or found[3].lower() != name.lower():
        raise OperationError(f"{name}: the controller answered {text[:80]!r}")
    code = int(found[1])
    if code:
        raise OperationError(f"{name}: {REASONS.get(code, f'error {code}')}", code=code)
    return found[2]


def first_alarm(value: str) -> int:
    """Return the first alarm in the value of ``GetErrorID``, ``[[17],[],…]``; 0: none.

    The first list is the controller's; alarms of a joint's drive are numbered by ``joint_alarm``.
    """
    for joint, part in enumerate(re.findall(r"\[([^\[\]]*)\]", value)):
        if found := re.search(r"-?\d+", part):
            return joint_alarm(joint, int(found[0])) if joint else int(found[0])
    return 0


JOINT_ALARMS = 100_000  # alarm 16 of the drive of joint 3 is 300016


def joint_alarm(joint: int, code: int) -> int:
    """Return the number of an alarm of a joint's drive; joints count from 1."""
    return joint * JOINT_ALARMS + code
