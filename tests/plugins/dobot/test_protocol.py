"""Messages as the maker's guides have them, and alarms in words."""

from __future__ import annotations

import numpy as np
import pytest
from tests.plugins.dobot.packet import PACKET

from robotd.api import NotReady, OperationError
from robotd_dobot import protocol
from robotd_dobot.code_tables import ALARMS, alarm_text

TARGET = np.array([1.0, -2.5, 0.0, 0.0, 0.0, 180.0])
IN_THE_GUIDE = {
    "size": "length", "inputs": "digital_inputs", "outputs": "digital_outputs",
    "mode": "robot_mode", "test_value": "test_value", "position": "q_actual",
    "velocity": "qd_actual", "user_frame": "user_index", "tool_frame": "tool_index",
    "enabled": "enable_status", "dragged": "drag_status",
    "error": "error_status", "model": "robot_type", "load_kg": "load",
    "load_center_mm": "load_center",
}  # fmt: skip


def test_fields_are_where_the_guide_has_them() -> None:
    assert protocol.FEEDBACK.itemsize == PACKET.itemsize == 1440
    own, guide = protocol.FEEDBACK.fields, PACKET.fields
    assert own is not None
    assert guide is not None
    assert {name: own[name][1] for name in own} == {
        name: guide[IN_THE_GUIDE[name]][1] for name in own
    }


def test_commands_are_text() -> None:
    assert protocol.command("EnableRobot") == "EnableRobot()"
    assert protocol.command("DOInstant", 3, True) == "DOInstant(3,1)"
    assert protocol.command("EnableRobot", 0.5, 0.0, 0.0, 32.5) == "EnableRobot(0.5,0,0,32.5)"


def test_a_target_has_its_options_by_name_or_by_place() -> None:
    angles = "1.000000,-2.500000,0.000000,0.000000,0.000000,180.000000"
    assert protocol.V4.servo_target(TARGET, 0.03) == f"ServoJ({angles},t=0.0300)"
    named = f"ServoJ({angles},t=0.0300,aheadtime=50,gain=700)"
    assert protocol.V4.servo_target(TARGET, 0.03, gain=700) == named
    placed = f"ServoJ({angles},0.0300,30,500)"
    assert protocol.V3.servo_target(TARGET, 0.03, lookahead=30) == placed


def test_a_reply_has_the_value_of_its_command() -> None:
    assert protocol.parse_reply("0,{5},RobotMode();", "RobotMode") == "5"
    assert protocol.parse_reply("0,{},SpeedFactor(100);", "SpeedFactor") == ""


@pytest.mark.parametrize(
    ("reply", "reason"),
    [
        ("-2,{},EnableRobot();", "EnableRobot: the controller is in alarm"),
        ("-42,{},EnableRobot();", "EnableRobot: error -42"),
        ("0,{5},RobotMode();", "EnableRobot: the controller answered"),
        ("what?", "EnableRobot: the controller answered 'what"),
    ],
)
def test_what_is_wrong_with_a_reply_is_told(reply: str, reason: str) -> None:
    with pytest.raises(OperationError, match=reason):
        protocol.parse_reply(reply, "EnableRobot")


def test_a_controller_that_does_not_obey_tcp_says_so() -> None:
    with pytest.raises(NotReady, match="EnableRobot: the controller is not in TCP mode"):
        protocol.parse_reply("Control Mode Is Not Tcp\t", "EnableRobot")


def test_the_first_alarm_counts() -> None:
    assert protocol.first_alarm("[[17,18],[],[],[],[],[],[]]") == 17
    assert protocol.first_alarm("[[],[],[9040],[],[],[],[]]") == 209040
    assert protocol.first_alarm("[[-2],[],[],[],[],[],[]]") == -2
    assert protocol.first_alarm("[[],[],[],[],[],[],[]]") == 0


def test_every_alarm_has_a_text() -> None:
    assert ALARMS.line(50) == "alarm of a Dobot controller 50: joint 3 is too fast"
    assert (
        ALARMS.line(209040)
        == "alarm of a Dobot controller 209040: drive of joint 2, 9040: overload"
    )
    assert alarm_text(17) == "inverse kinematics without a solution"
    assert ALARMS.line(103) == "alarm of a Dobot controller 103: joint 3 has been disabled"
    assert "payload" in ALARMS.advice(300016)


def test_an_alarm_that_is_not_known_says_where_to_look() -> None:
    assert alarm_text(9999) == "look it up in DobotStudio Pro, or in the maker's lists of alarms"
    assert alarm_text(409999).startswith("drive of joint 4, 9999: look it up in DobotStudio Pro")
    assert ALARMS.advice(409999) == "Look at it in the maker's software"
    assert ALARMS.advice(9999) == ""


def test_numbers_of_drives_are_no_alarms_of_the_controller() -> None:
    """10 is a software limit of a drive; the controller has no such alarm."""
    assert "software limit" in alarm_text(100010)
    assert ALARMS.advice(10) == ""


def test_every_alarm_has_a_remedy() -> None:
    assert not [code for code in ALARMS.texts if not ALARMS.advice(code)]
    assert not [text for text in ALARMS.texts.values() if not text or "{" in text]


def test_other_numbers_are_of_other_devices() -> None:
    assert ALARMS.line(0x8611) == ""
