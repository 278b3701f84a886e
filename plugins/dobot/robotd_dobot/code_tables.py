"""Alarms of the controller in words, for ``robotd explain``, the page and the process image.

The maker publishes the whole list with its client libraries; these are the ones that a user of
streamed joint targets meets.
"""

from __future__ import annotations

from robotd.api import CodeTable
from robotd_dobot.protocol import JOINT_ALARMS, JOINTS

SLOWER = "Move it slower, or away from the singularity"
BACK = "Jog the joint back with the maker's software, or by hand in drag mode"
RESTART = "Switch the controller off and on; if it comes back, ask the maker"
STREAM = "Check payload, speed, gain and t of the stream"
FREE = "Free the arm from what it touches; check the payload and the collision level"
WIRING = "Check the cables of the cabinet, then switch it off and on"

_PER_JOINT = (
    # first number, step, text, remedy
    (48, 1, "joint {} is too fast", SLOWER),
    (
        54,
        1,
        "joint {} does not follow its targets",
        "Check payload, speed, gain and t of the stream",
    ),
    (64, 2, "joint {} is at its positive limit", BACK),
    (65, 2, "joint {} is at its negative limit", BACK),
    (80, 1, "joint {} has lost steps", RESTART),
    (97, 3, "joint {} has been disabled", "Switch the arm on again"),
)
_SINGLE = {
    -3: ("the safety skin has touched something", FREE),
    -2: ("the arm has hit something", FREE),
    -1: ("an alarm without a number", "Look at the maker's software for it"),
    16: ("the target is close to the shoulder singularity", SLOWER),
    17: ("inverse kinematics without a solution", "Choose another pose"),
    18: ("the pose is out of the working area", "Choose another pose"),
    26: ("the target is close to the wrist singularity", SLOWER),
    27: ("the target is close to the elbow singularity", SLOWER),
    37: ("a target is more than 180° away", "Look for a second client that sends targets"),
    76: ("the arm would touch itself", "Choose another pose"),
    77: ("the arm would touch itself", "Choose another pose"),
    78: ("the arm would touch itself", "Choose another pose"),
    115: ("the arm cannot be switched on", WIRING),
    116: ("the emergency stop is pressed", "Release the emergency stop"),
    117: ("the arm has hit something", FREE),
    118: ("the safety terminals do not answer", WIRING),
    119: ("the safety skin has touched something", FREE),
    121: ("the controller could not start", RESTART),
    122: ("the contactor is open", WIRING),
    126: ("the switch of the cabinet is pressed", "Release it, and switch the power on"),
    130: ("the terminals of the cabinet do not answer", WIRING),
    131: ("the terminals of the tool do not answer", WIRING),
    134: (
        "a joint has moved while the arm was switched on",
        "Check the payload and the mounting angle in the maker's software",
    ),
    161: ("the control mode could not be changed", RESTART),
}
_OF_CONTROLLER = _SINGLE | {
    first + step * joint: (text.format(joint + 1), remedy)
    for first, step, text, remedy in _PER_JOINT
    for joint in range(JOINTS)
}
_OF_DRIVE = {
    10: ("the position is beyond the software limit", BACK),
    11: ("the position is beyond the end stop", BACK),
    14: ("the drive has no power", WIRING),
    16: ("the joint does not follow its targets", STREAM),
    20: ("the drive is off", "Switch the arm on again"),
    8992: ("current too high", RESTART),
    9040: ("overload", FREE),
    12816: ("supply voltage too high", WIRING),
    12832: ("supply voltage too low", WIRING),
    16912: ("the motor is too hot", "Let it cool down; check the payload"),
    17168: ("the drive is too hot", "Let it cool down"),
    28961: ("the motor is blocked", FREE),
    29056: ("the motor is overloaded", FREE),
    29057: ("the brake does not work", RESTART),
    29059: ("the drive cannot be switched on", WIRING),
    29568: ("the encoder does not answer", RESTART),
    33920: ("the motor is too fast", SLOWER),
    33922: ("the motor has stalled", FREE),
    34321: (
        "the joint does not follow its targets",
        "Check payload, speed, gain and t of the stream",
    ),
}


def _drive_text(code: int) -> str:
    joint, number = divmod(code, JOINT_ALARMS)
    if not 1 <= joint <= JOINTS:
        return ""
    text = _OF_DRIVE[number][0] if number in _OF_DRIVE else "see the maker's list of drive alarms"
    return f"drive of joint {joint}, {number}: {text}"


def _remedy(code: int) -> str:
    known = _OF_CONTROLLER.get(code) or _OF_DRIVE.get(code % JOINT_ALARMS)
    return known[1] if known else ""


ALARMS = CodeTable(
    "alarm of a Dobot controller",
    {code: text for code, (text, _) in _OF_CONTROLLER.items()},
    digits=0,
    other=_drive_text,
    remedy=_remedy,
)


def alarm_text(code: int) -> str:
    """Return the text of ``code``; it always has one."""
    return ALARMS.texts.get(code) or _drive_text(code) or "see the maker's list of alarms"
