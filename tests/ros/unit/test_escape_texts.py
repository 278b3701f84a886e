"""Texts of other programs in what a command prints."""

from __future__ import annotations

import json

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from sensor_msgs.msg import JointState

from robotd_ros.client.fleet import read_identity, read_summary
from robotd_ros.client.ros_client import escape_texts

HOSTILE, HARMLESS = "a\x1b[2J\nü", "a\\x1b[2J\nü"


def test_texts_at_every_depth_are_escaped() -> None:
    status = DiagnosticStatus(name=HOSTILE, values=[KeyValue(key="k", value=HOSTILE)])
    message = DiagnosticArray(status=[status])
    message.header.frame_id = HOSTILE
    escape_texts(message)
    assert message.header.frame_id == message.status[0].name == HARMLESS
    assert message.status[0].values[0].value == HARMLESS


def test_lists_of_names_are_escaped_and_numbers_stay() -> None:
    message = JointState(name=["joint1", HOSTILE], position=[1.0, 2.0])
    escape_texts(message)
    assert message.name == ["joint1", HARMLESS]
    assert list(message.position) == [1.0, 2.0]


def test_what_robots_say_of_themselves_is_escaped_in_one_line() -> None:
    said = dict.fromkeys(("robot", "computer", "state"), HOSTILE)
    lists = {"problems": [HOSTILE], "owners": [HOSTILE]}
    robot = read_summary(json.dumps({**said, **lists, "pid": 7, "uptime_s": 1.0}))
    assert robot is not None
    one_line = HARMLESS.replace("\n", "; ")
    assert robot.identity.robot == robot.identity.computer == robot.state == one_line
    assert robot.problems == robot.owners == (one_line,)


@pytest.mark.parametrize("text", ["{", "[]", "null", "7", '"text"'])
def test_what_is_no_identity_tells_nothing(text: str) -> None:
    assert read_identity(text) == read_identity("{}")
    assert read_summary(text) is None
