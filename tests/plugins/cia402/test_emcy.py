from collections import deque

import pytest
from tests.plugins.cia402.looped_drive import LoopedDrive

from robotd_cia402.code_tables import error_text
from robotd_cia402.node import Emergency, FieldbusNode


@pytest.mark.parametrize(
    ("code", "text"),
    [
        (0x3210, "0x3210 DC link over-voltage"),
        (0x2311, "0x2311 current, device output side"),
        (0x8611, "0x8611 following error"),
        (0xFF07, "0xFF07 vendor specific"),
        (0x1234, "0x1234 generic error"),
        (0x0000, "0x0000 no error"),
        (0x0012, "0x0012 error reset or no error"),
        (0x0129, "0x0129 reserved"),  # not the class 0x00
    ],
)
def test_codes_in_words(code: int, text: str) -> None:
    assert error_text(code) == text


def test_a_reset_ends_what_is_in_force_and_stays_in_the_history() -> None:
    history = deque[Emergency](maxlen=3)
    node = FieldbusNode("node", 5, "joint5", history)
    node.note_emergency(bytes.fromhex("1032010102030405"), 1)
    assert "node 5: EMCY 0x3210" in str(node.emergency)
    assert "01 02 03 04 05" in node.emergency_text()
    node.note_emergency(bytes(8), 2)
    assert node.emergency is None
    assert len(history) == 2


def test_a_reset_with_remaining_errors_is_no_end() -> None:
    """One, but not all errors are gone (CiA 301, 7.2.7.1)."""
    history = deque[Emergency](maxlen=5)
    node = FieldbusNode("node", 5, "joint5", history)
    node.note_emergency(bytes.fromhex("1032050000000000"), 1)
    node.note_emergency(bytes.fromhex("1043090000000000"), 2)
    node.note_emergency(bytes.fromhex("0000050000000000"), 3)
    remaining = "EMCY 0x0000 one error is gone, remaining error register 0x05 (generic, voltage)"
    assert node.emergency_text() == f", {remaining}"
    node.note_emergency(bytes(8), 4)
    assert node.emergency is None
    assert len(history) == 4


def test_the_error_code_of_the_drive_says_more_than_the_class_of_remaining_errors() -> None:
    looped = LoopedDrive()
    looped.commands.enable(1.0)
    looped.drive.trip(0x3210)
    looped.run(0.5)
    looped.objects.node.note_emergency(bytes.fromhex("0000050000000000"), 1)
    assert looped.axis.report.alarm_text == "error code 0x3210 DC link over-voltage"


def test_an_emergency_from_before_a_reset_is_not_in_force() -> None:
    node = FieldbusNode("node", 5, "joint5", deque())
    node.note_emergency(bytes.fromhex("1032010102030405"), 5)
    node.forget_emergency_before(5)
    assert node.emergency is not None
    node.forget_emergency_before(6)
    assert node.emergency is None


def test_a_frame_of_another_length_is_rejected() -> None:
    with pytest.raises(ValueError, match="8 bytes, this one 7"):
        Emergency.decode(5, bytes(7), 0)
