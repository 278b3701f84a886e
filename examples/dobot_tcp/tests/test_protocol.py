"""Messages as the controller has them."""

from __future__ import annotations

import numpy as np
import pytest
from robotd_dobot_tcp import protocol
from robotd_dobot_tcp.alarms import ALARMS, alarm_text

from robotd.api import OperationError


def test_a_packet_has_1440_bytes() -> None:
    assert protocol.FEEDBACK.itemsize == 1440


def test_commands_are_text() -> None:
    assert protocol.command("EnableRobot") == "EnableRobot()"
    assert protocol.command("DOExecute", 3, True) == "DOExecute(3,1)"
    target = protocol.servo_target(np.array([1.0, -2.5, 0.0, 0.0, 0.0, 180.0]), 0.008)
    assert target.startswith(b"ServoJ(1.000000,-2.500000,")
    assert target.endswith(b",180.000000,t=0.0080)")


def test_a_reply_has_the_value_of_its_command() -> None:
    assert protocol.parse_reply("0,{5},RobotMode();", "RobotMode") == "5"
    assert protocol.parse_reply("0,{},SpeedFactor(100);", "SpeedFactor") == ""


@pytest.mark.parametrize(
    ("reply", "reason"),
    [
        ("-2,{},EnableRobot();", "EnableRobot: the controller is in alarm"),
        ("-7,{},EnableRobot();", "EnableRobot: error -7"),
        ("0,{5},RobotMode();", "EnableRobot: the controller answered"),
        ("Control Mode Is Not Tcp;", "EnableRobot: the controller answered 'Control Mode"),
    ],
)
def test_what_is_wrong_with_a_reply_is_told(reply: str, reason: str) -> None:
    with pytest.raises(OperationError, match=reason):
        protocol.parse_reply(reply, "EnableRobot")


def test_the_first_alarm_counts() -> None:
    assert protocol.first_alarm("[[17,18],[],[],[],[],[],[]]") == 17
    assert protocol.first_alarm("[[],[],[48],[],[],[],[]]") == 48
    assert protocol.first_alarm("[[],[],[],[],[],[],[]]") == 0


def test_every_alarm_has_a_text() -> None:
    assert ALARMS.line(48) == "alarm of a Dobot CR controller 48: joint 1 too fast"
    assert alarm_text(17) == "inverse kinematics without a solution"
    assert alarm_text(9999) == "see the alarm list of the controller"
