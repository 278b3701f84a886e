"""Texts of other programs in what a command prints."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from sensor_msgs.msg import JointState

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
