"""Alarms of the controller in words, for ``robotd explain``, the page and the process image.

Numbers and meanings are those of the lists that the maker ships with its client libraries
(``alarm_controller``, ``alarm_servo``). Left out are alarms of programs on the controller, which
robotd does not run: the parameters of each command, Modbus, welding, tracking.
"""

from __future__ import annotations

from collections.abc import Mapping

from robotd.api import CodeTable
from robotd_dobot.protocol import JOINT_ALARMS, JOINTS

SLOWER = "Move it slower, or away from the singularity"
POSE = "Choose another pose"
BACK = "Jog the joint back with the maker's software, or by hand in drag mode"
STREAM = "Check payload, speed, gain and t of the stream"
FREE = "Free the arm from what it touches; check the payload and the collision level"
RELEASE = "Release the emergency stop"
AGAIN = "Switch the arm on again"
RETRY = "Try it again; if it comes back, ask the maker"
COOL = "Let it cool down; check the payload, and the fan of the cabinet"
SUPPLY = "Check the supply of the cabinet, then switch it off and on"
WIRING = "Check the cables of the cabinet, then switch it off and on"
RESTART = "Switch the controller off and on; if it comes back, ask the maker"
TOOL = "Check the wiring and the current of the tool"
FORCE = "Check the force sensor in the maker's software"
PROGRAM = "Look at it in the maker's software"
UNKNOWN = "look it up in DobotStudio Pro, or in the maker's lists of alarms"

_PER_JOINT = (
    # first number, step, text, remedy
    (41, 1, "joint {} has gone back after a collision", FREE),
    (48, 1, "joint {} is too fast", SLOWER),
    (54, 1, "joint {} does not follow its targets", STREAM),
    (64, 2, "joint {} is at its positive limit", BACK),
    (65, 2, "joint {} is at its negative limit", BACK),
    (80, 1, "joint {} has lost steps", RESTART),
    (96, 3, "joint {} is in a wrong state", RESTART),
    (97, 3, "joint {} has been disabled", AGAIN),
    (225, 1, "joint {} does not follow its targets", STREAM),
    (242, 1, "joint {} does not follow its targets", STREAM),
    (248, 1, "joint {} does not reach its target", STREAM),
    (12290, 1, "the drive of joint {} is not on the bus", RESTART),
    (12298, 1, "the drive of joint {} is too hot", COOL),
)
_BY_REMEDY: Mapping[str, Mapping[int, str]] = {
    SLOWER: {
        16: "the target is close to the shoulder singularity",
        26: "the target is close to the wrist singularity",
        27: "the target is close to the elbow singularity",
        32: "the arm is at the shoulder singularity",
        35: "the arm is at the wrist singularity",
        36: "the arm is at the elbow singularity",
    },
    POSE: {
        17: "inverse kinematics without a solution",
        18: "the pose is out of the working area",
        30: "inverse kinematics with all parameters failed",
        33: "inverse kinematics without a solution on the way",
        34: "the way leaves the working area",
        **dict.fromkeys((76, 77, 78), "the arm would touch itself"),
        16386: "inverse kinematics without a solution",
    },
    FREE: {
        **dict.fromkeys((-2, 117), "the arm has hit something"),
        **dict.fromkeys((-3, 119), "the safety skin has touched something"),
        254: "the motion cannot go on after a collision",
        16384: "an obstacle is in the way",
    },
    "Look for a second client that sends targets": {37: "a target is more than 180° away"},
    "Check target_period_s, lookahead and gain; look for a second client that sends targets": {
        212: "the targets of ServoJ cannot be followed"
    },
    "Jog the arm back from the wall in the maker's software; check the tool frame there": {
        224: "tool or elbow is beyond a safety wall"
    },
    "Check the payload and the mounting angle in the maker's software": {
        134: "a joint has moved while the arm was switched on"
    },
    RELEASE: {
        116: "the emergency stop is pressed",
        165: "an emergency stop is pressed, of the cabinet or by software",
        1008: "the emergency stop was pressed while the arm got power",
        12288: "the emergency stop is pressed",
        12289: "an external emergency stop is pressed",
    },
    "Release it, and switch the power on": dict.fromkeys(
        (126, 24583), "the switch of the cabinet is pressed"
    ),
    AGAIN: {
        1007: "the arm got no power: fault in the controller",
        1009: "the arm got no power: fault of communication",
        1363: "the arm got no power",
        12296: "the arm has lost its power",
    },
    RETRY: {
        1000: "drag mode has not ended when the arm was switched off",
        **dict.fromkeys((1004, 1367), "drag mode has not ended"),
        1360: "the arm could not be switched off",
        1361: "a brake could not be opened",
        1362: "a brake could not be closed",
        1366: "drag mode has not begun",
        1368: "the global speed could not be set",
        1369: "the payload could not be set",
        1375: "the tool frame could not be set",
        1376: "the user frame could not be set",
        1377: "an output of the tool could not be set",
        1378: "an output could not be set",
        1379: "an analog output could not be set",
    },
    COOL: {
        170: "the control board is too hot",
        12297: "the processor of the controller is too hot",
    },
    SUPPLY: {
        124: "the check of the mains supply failed",
        **dict.fromkeys((132, 24588), "the 24 V buffer does not charge"),
        **dict.fromkeys((133, 24589), "the 48 V buffer does not charge"),
        162: "supply voltage of the control board too low",
        163: "supply voltage of the control board too high",
        164: "the braking circuit has a fault",
        167: "short circuit in the supply of the arm",
        **dict.fromkeys((1775, 24581), "the check of the mains supply failed"),
        **dict.fromkeys((20481, 20484), "supply voltage of the arm too high"),
        **dict.fromkeys((20482, 20485), "supply voltage of the arm too low"),
        **dict.fromkeys((20486, 20487, 20488), "a voltage of the braking circuit is wrong"),
        20489: "current of the braking circuit too high",
        20491: "current of the arm too high",
        20490: "the braking resistor is overloaded",
        **dict.fromkeys((20492, 20494), "the arm could not get its power slowly"),
    },
    WIRING: {
        115: "the arm cannot be switched on",
        118: "the safety terminals do not answer",
        **dict.fromkeys((122, 1772, 24578), "the contactor is open"),
        **dict.fromkeys((123, 1773, 24579), "the braking circuit does not confirm the power"),
        **dict.fromkeys((125, 127, 1776, 20480), "the braking circuit does not answer"),
        130: "the terminals of the cabinet do not answer",
        131: "the terminals of the tool do not answer",
        166: "the line of the emergency stop has a fault",
        173: "the cabinet could not be shut down",
        4118: "the control board does not answer",
        20483: "the current limiter has a fault",
        20493: "the fan circuit has a short circuit",
        24576: "the safety terminals do not answer",
        **dict.fromkeys((24582, 24584), "the braking circuit does not answer"),
    },
    RESTART: {
        121: "the controller could not start",
        128: "an internal time-out of the controller",
        161: "the control mode could not be changed",
        **dict.fromkeys(range(1320, 1347), "a configuration file of the controller is missing"),
        1359: "a file is missing that the controller starts with",
        4096: "the file of the mechanical parameters is missing",
        8448: "the model of the arm is not known to the controller",
    },
    TOOL: {
        180: "overcurrent at output 1 of the tool",
        181: "overcurrent at output 2 of the tool",
        182: "overcurrent at the 24 V supply of the tool",
    },
    FORCE: {
        120: "the force sensor is not switched on",
        176: "force control has timed out",
        178: "values of the force sensor are out of range",
        179: "the force sensor is not switched on",
        240: "the tool presses with more than its limit",
    },
    PROGRAM: {
        -1: "an alarm without a number",
        114: "homing failed",
        160: "the motion cannot be paused",
        177: "force control cannot be paused",
        **dict.fromkeys(range(8192, 8201), "a program on the controller cannot be loaded"),
    },
}
_OF_CONTROLLER = {
    code: (text, remedy) for remedy, texts in _BY_REMEDY.items() for code, text in texts.items()
} | {
    first + step * joint: (text.format(joint + 1), remedy)
    for first, step, text, remedy in _PER_JOINT
    for joint in range(JOINTS)
}

_DRIVE_BY_REMEDY: Mapping[str, Mapping[int, str]] = {
    BACK: {
        10: "the position is beyond the software limit",
        11: "the position is beyond the end stop",
    },
    STREAM: {
        **dict.fromkeys((16, 34321), "the joint does not follow its targets"),
        33921: "the joint does not follow its speed",
        34322: "the target is out of range",
    },
    SLOWER: {
        33920: "the motor is too fast",
        40: "the target is too fast",
        41: "the target accelerates too fast",
        42: "the target brakes too fast",
    },
    FREE: {
        9040: "overload",
        28961: "the motor is blocked",
        29056: "the motor is overloaded",
        33922: "the motor has stalled",
    },
    AGAIN: {
        **dict.fromkeys((20, 170), "the drive is off"),
        33: "the drive was switched off in motion",
    },
    COOL: {16912: "the motor is too hot", 17168: "the drive is too hot"},
    SUPPLY: {
        12592: "a phase of the supply is missing",
        12816: "supply voltage too high",
        12832: "supply voltage too low",
        29058: "the braking resistor is overloaded",
    },
    WIRING: {
        14: "the drive has no power",
        13184: "the phases of the motor are swapped",
        13185: "a phase of the motor is missing",
        21122: "the wiring of STO has a fault",
        29059: "the drive cannot be switched on",
    },
    RESTART: {
        2: "the axis has a fault",
        3: "the drive has lost its synchronous mode",
        **dict.fromkeys((123, 30080, 60929), "the drive does not answer"),
        **dict.fromkeys((60944, 60945, 60946, 60948, 60949), "the drive is not operational"),
        35: "the drive has a fault in motion",
        8752: "overcurrent in the power stage",
        8992: "current too high",
        9088: "the offset of the current measurement is too large",
        **dict.fromkeys((21008, 21569), "the power stage does not answer"),
        **dict.fromkeys((21120, 21121), "internal error of the drive"),
        29057: "the brake does not work",
        29568: "the encoder does not answer",
        **dict.fromkeys((29569, 29571, 29572), "the encoder has a fault"),
        29570: "the battery of the encoder is empty",
        **dict.fromkeys((29573, 29574, 29575), "the second encoder has a fault"),
        29584: "the position of the joint is wrong",
    },
}
_OF_DRIVE = {
    code: (text, remedy)
    for remedy, texts in _DRIVE_BY_REMEDY.items()
    for code, text in texts.items()
}


def _drive_text(code: int) -> str:
    joint, number = divmod(code, JOINT_ALARMS)
    if not 1 <= joint <= JOINTS:
        return ""
    text = _OF_DRIVE[number][0] if number in _OF_DRIVE else UNKNOWN
    return f"drive of joint {joint}, {number}: {text}"


def _remedy(code: int) -> str:
    """Return the remedy of an alarm; of a drive whose number is not known: where to look."""
    if known := _OF_CONTROLLER.get(code):
        return known[1]
    joint, number = divmod(code, JOINT_ALARMS)
    if not 1 <= joint <= JOINTS:
        return ""
    return _OF_DRIVE[number][1] if number in _OF_DRIVE else PROGRAM


ALARMS = CodeTable(
    "alarm of a Dobot controller",
    {code: text for code, (text, _) in _OF_CONTROLLER.items()},
    digits=0,
    other=_drive_text,
    remedy=_remedy,
)


def alarm_text(code: int) -> str:
    """Return the text of ``code``; it always has one."""
    return ALARMS.texts.get(code) or _drive_text(code) or UNKNOWN
